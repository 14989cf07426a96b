// Theme and keys of the whole page; what there is, is shown.
function setTheme(name) {
  document.documentElement.dataset.theme = name;
  if (map.values.length) drawMap();
  if (motion.own) drawMotion();
  drawSolid();
  drawCharts();
}

async function start() {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  element("title").textContent = content.title;
  document.documentElement.dataset.theme = dark.matches ? "dark" : "light";
  dark.addEventListener("change", () => setTheme(dark.matches ? "dark" : "light"));
  element("theme").addEventListener("click", () =>
    setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
  element("play").addEventListener("click", () => play(motion.playing === null));
  element("time").addEventListener("input", (event) => { play(false); setRow(Number(event.target.value)); });
  document.addEventListener("keydown", (event) => {
    if (event.key !== " " || !motion.own || ["BUTTON", "SELECT"].includes(event.target.tagName)) return;
    event.preventDefault();
    play(motion.playing === null);
  });
  if (content.notes) element("notes").textContent = content.notes;
  // What is alone takes the whole width.
  document.querySelector("main").classList.toggle("alone", !content.map);
  document.querySelector("main").classList.toggle("still", !content.motions.length && !content.solid);
  element("motion-keys").hidden = !content.motions.length;
  element("motion-side").hidden = !content.motions.length;
  element("solid-side").hidden = !content.solid;
  if (content.map) await startMap();
  await startSolid();
  await startCharts();
  if (content.motions.length) await showMotion(content.shown ?? 0);
  document.documentElement.dataset.ready = "yes";
}

start();
