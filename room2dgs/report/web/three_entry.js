// What the pages of runs use of three.js; README.md says how three.min.js is made of it.
export {
  AmbientLight, BackSide, BufferAttribute, BufferGeometry, CanvasTexture, ColorManagement, DataTexture, DirectionalLight, DoubleSide,
  FloatType, FrontSide, GLSL3, Group, InstancedBufferAttribute, InstancedBufferGeometry, Line, LinearSRGBColorSpace, LineBasicMaterial,
  LineSegments, Matrix4, Mesh, MeshBasicMaterial, MeshLambertMaterial, NearestFilter, PerspectiveCamera, Quaternion, RawShaderMaterial,
  Raycaster, REVISION, RGBAFormat, Scene, Sprite, SpriteMaterial, Texture, Vector2, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
