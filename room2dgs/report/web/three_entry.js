// What the run's page uses of three.js; README.md says how three.min.js is made of it.
export {
  AmbientLight, BackSide, BufferAttribute, BufferGeometry, CanvasTexture, ColorManagement, DataTexture, DirectionalLight, FloatType, FrontSide,
  GLSL3, InstancedBufferAttribute, InstancedBufferGeometry, LinearSRGBColorSpace, Mesh, MeshBasicMaterial, MeshLambertMaterial,
  NearestFilter, PerspectiveCamera, RawShaderMaterial, REVISION, RGBAFormat, Scene, Sprite, SpriteMaterial, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
