// Photo against what the run made of it: a wipe over the picture, a choice of views and of what stands beside the photo.
"use strict";

(() => {
  const box = document.getElementById("compare");
  if (!box) return;
  const views = JSON.parse(document.getElementById("views").textContent);
  const [chosen, wiper, left, right, note, line] = ["view", "wiper", "left", "right", "note", "line"].map((name) =>
    document.getElementById("compare-" + name),
  );
  const kinds = document.getElementById("compare-kinds");
  let kind = "rendering";

  function draw() {
    const view = views[chosen.value];
    if (!(kind in view.pictures)) kind = "rendering";
    left.src = view.pictures.photo;
    right.src = view.pictures[kind];
    note.textContent = view.note;
    for (const button of kinds.children) {
      button.hidden = !(button.dataset.kind in view.pictures);
      button.setAttribute("aria-pressed", String(button.dataset.kind === kind));
    }
    for (const key of document.querySelectorAll("[data-kind-key]")) key.hidden = key.dataset.kindKey !== kind;
  }
  function wipe() {
    left.style.clipPath = `inset(0 ${100 - wiper.value}% 0 0)`;
    line.style.left = wiper.value + "%";
  }
  for (const [index, view] of views.entries()) {
    const option = document.createElement("option");
    option.value = String(index);
    option.textContent = view.title;
    chosen.append(option);
  }
  chosen.addEventListener("change", draw);
  wiper.addEventListener("input", wipe);
  kinds.addEventListener("click", (event) => {
    if (!event.target.dataset.kind) return;
    kind = event.target.dataset.kind;
    draw();
  });
  chosen.value = "0";
  draw();
  wipe();
})();
