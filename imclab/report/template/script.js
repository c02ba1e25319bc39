// Each comparator lays the simulated picture over the measured one: a divider that is slid, or a
// blink. Without this script, and on paper, both stand side by side.
const still = matchMedia("(prefers-reduced-motion: reduce)");
for (const box of document.querySelectorAll(".compare")) {
  const stage = box.querySelector(".stage");
  const slider = stage.querySelector("input");
  const buttons = [...box.querySelectorAll("button")];
  const told = box.querySelector("[aria-live]");
  let timer = 0;
  const flip = () => {
    const second = stage.classList.toggle("second");
    if (still.matches) told.textContent = second ? "simulated" : "measured";
  };
  const show = (mode) => {
    clearInterval(timer);
    told.textContent = "";
    if (mode === "blink" && still.matches && stage.classList.contains("blink")) return flip();
    stage.classList.remove("slide", "blink", "side", "second");
    stage.classList.add(mode);
    for (const button of buttons) button.setAttribute("aria-pressed", String(button.value === mode));
    if (mode === "blink" && !still.matches) timer = setInterval(flip, 700);
  };
  slider.addEventListener("input", () => stage.style.setProperty("--cut", `${slider.value}%`));
  for (const button of buttons) button.addEventListener("click", () => show(button.value));
  box.classList.add("ready");
  for (const part of box.querySelectorAll("[hidden]")) part.hidden = false;
  show("slide");
}
