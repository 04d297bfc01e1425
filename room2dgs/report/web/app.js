// The page of `room2dgs app`: what is dropped goes to the server, which runs it; the state is asked for every second.
"use strict";

(() => {
  const find = (id) => document.getElementById(id);
  const base = location.pathname; // ends with the token and a slash
  let files = null; // [path, File] of what was dropped
  let busy = false;

  async function ask(what, options = {}) {
    const answer = await fetch(base + what, options);
    const value = await answer.json();
    if (!answer.ok) throw new Error(value.why);
    return value;
  }
  const post = (what, value) => ask(what, { method: "POST", body: JSON.stringify(value) });
  function complain(error) {
    find("why").textContent = error ? error.message : "";
    find("why").hidden = !error;
  }

  function chosen(found) {
    files = found.filter(([path]) => !path.split("/").some((part) => part.startsWith(".")));
    const size = files.reduce((sum, [, file]) => sum + file.size, 0);
    const name = files.length ? files[0][0].split("/")[0] : "nothing";
    find("dropped").textContent = `${name}: ${files.length} ${files.length === 1 ? "file" : "files"}, ${(size / 1e6).toFixed(1)} MB`;
    find("path").value = "";
  }
  async function entries(entry, path = "") {
    if (entry.isFile) return [[path + entry.name, await new Promise((done, fail) => entry.file(done, fail))]];
    const reader = entry.createReader(), found = [];
    for (;;) {
      const some = await new Promise((done, fail) => reader.readEntries(done, fail)); // a hundred at a time
      if (!some.length) return found;
      for (const one of some) found.push(...(await entries(one, `${path}${entry.name}/`)));
    }
  }
  const drop = find("drop");
  for (const type of ["dragenter", "dragover"]) {
    drop.addEventListener(type, (event) => {
      event.preventDefault();
      drop.classList.add("over");
    });
  }
  drop.addEventListener("dragleave", () => drop.classList.remove("over"));
  drop.addEventListener("drop", async (event) => {
    event.preventDefault();
    drop.classList.remove("over");
    const dropped = [...event.dataTransfer.items].map((item) => item.webkitGetAsEntry()).filter(Boolean);
    const found = [];
    for (const entry of dropped) found.push(...(await entries(entry)));
    chosen(found);
  });
  for (const kind of ["folder", "video"]) {
    find(kind).addEventListener("click", () => find("pick-" + kind).click());
    find("pick-" + kind).addEventListener("change", (event) =>
      chosen([...event.target.files].map((file) => [file.webkitRelativePath || file.name, file])));
  }

  async function start() {
    const preset = document.querySelector("[name=preset]:checked").value, path = find("path").value.trim();
    if (path || !files) return post("start", { path, preset });
    const { upload } = await post("new", {});
    for (const [number, [name, file]] of files.entries()) {
      find("dropped").textContent = `${number + 1} of ${files.length}: ${name}`;
      await ask(`upload?upload=${upload}&name=${encodeURIComponent(name)}`, { method: "PUT", body: file });
    }
    return post("start", { upload, preset });
  }
  find("start").addEventListener("click", async () => {
    complain(null);
    busy = find("start").disabled = true;
    try {
      await start();
    } catch (error) {
      complain(error);
    }
    busy = false;
    await show();
  });
  find("stop").addEventListener("click", () => post("stop", {}).then(show, complain));

  function timeLeft(seconds) {
    if (seconds === null) return "";
    const whole = Math.round(seconds);
    return `, ${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")} left`;
  }
  async function show() {
    const { job, runs } = await ask("state");
    const running = job !== null && job.state === "running";
    find("work").hidden = job === null;
    find("ask").hidden = running;
    find("start").disabled = busy;
    if (job) {
      find("name").textContent = job.name;
      find("bar").value = job.share;
      const words = { done: "done", stopped: "stopped; what was finished is kept", failed: `failed: ${job.why}` };
      find("far").textContent = words[job.state] || `${Math.floor(100 * job.share)} %: ${job.what}${timeLeft(job.left_s)}`;
      find("stop").hidden = !running;
      find("look").hidden = !(job.state === "done" && runs.includes(job.name));
      find("look").href = `${base}runs/${encodeURIComponent(job.name)}/report.html`;
      find("log").textContent = job.lines.join("\n");
    }
    if (runs.length) {
      find("runs").replaceChildren(...runs.map((name) => {
        const item = document.createElement("li"), link = document.createElement("a");
        link.href = `${base}runs/${encodeURIComponent(name)}/report.html`;
        link.textContent = name;
        item.append(link);
        return item;
      }));
    }
  }
  (async function again() {
    try {
      if (!busy) await show();
    } catch (error) {
      complain(new Error("The server does not answer; was it ended?"));
    }
    setTimeout(again, 1000);
  })();
})();
