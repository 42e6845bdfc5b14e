"use strict";
// Runs before the script of an exported page, in a window of a phone's size. Frames are drawn when `pass` says so, so
// nothing depends on the speed of this machine. Leaves what it found in the surrounding document, as base64 of JSON:
// `faults`, in words, and `picture`, of the frame that HOLD tells the page to draw. GUESSED says whether half of the splats are
// guessed, or none.
(() => {
  // Few pixels: a software renderer draws them.
  Object.defineProperty(window, "devicePixelRatio", { value: 0.25 });
  let step;
  let now = 0;
  window.requestAnimationFrame = (next) => (step = next);
  /** Lets this many milliseconds pass, and draws a frame. */
  const pass = (milliseconds) => step((now += milliseconds));

  const faults = [];
  const check = (holds, what) => holds || faults.push(what);
  const element = (id) => document.getElementById(id);

  /** The pixels that are drawn now. */
  function pixels() {
    const gl = element("view").getContext("webgl2");
    const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
    const values = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, values);
    return values;
  }
  const same = (one, other) => one.length === other.length && one.every((value, i) => value === other[i]);
  const covered = (values) => values.filter((value, i) => i % 4 === 3 && value > 0).length;

  /** Presses a key; whether the page took it from the browser. */
  function press(key, target = document, more = {}) {
    const event = new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true, ...more });
    return !target.dispatchEvent(event);
  }
  /** What is drawn after a key. */
  function after(key, target) {
    press(key, target);
    pass(20);
    return pixels();
  }
  const playing = () => element("play").textContent === "Pause";

  function inside(control) {
    const { left, top, right, bottom } = control.getBoundingClientRect();
    return right > left && bottom > top && left >= 0 && top >= 0 && right <= innerWidth && bottom <= innerHeight;
  }
  function layout(state) {
    check(document.documentElement.scrollWidth <= innerWidth, `wider than the window ${state}`);
    check(document.documentElement.scrollHeight <= innerHeight, `higher than the window ${state}`);
    check(element("view").clientHeight > innerHeight / 3, `the person has little room ${state}`);
    for (const control of document.querySelectorAll("button, select, summary, #speed, #tint")) {
      check(inside(control), `${control.id || control.tagName} is outside of the window ${state}`);
    }
  }

  function keys() {
    check(document.activeElement === document.body, "something has the focus at first");
    pass(20);
    check(playing(), "does not play at first");
    const first = pixels();
    check(covered(first) > 0, "nobody is drawn");
    pass(50);
    check(!same(pixels(), first), "playing does not move the person");
    check(press(" ") && !playing(), "space does not pause");
    const still = after("x");
    pass(50);
    check(same(pixels(), still), "the person moves while paused");
    for (const [key, back] of [["ArrowLeft", "ArrowRight"], ["ArrowUp", "ArrowDown"]]) {
      check(!same(after(key), still), `${key} does not turn`);
      check(same(after(back), still), `${back} does not turn back`);
    }
    const near = covered(after("+"));
    check(near > covered(still), "+ does not come closer");
    check(covered(after("-")) < near, "- does not go back");
    check(press(" ") && playing(), "space does not play");
    check(press(" ", document, { repeat: true }) && playing(), "a key that is held pauses");
    check(!press("+", document, { ctrlKey: true }), "the browser's own keys are taken");
    press(" ");
  }

  function focus() {
    const still = after("x");
    for (const [control, key] of [
      [element("speed"), "ArrowLeft"], [element("clip"), "ArrowDown"], [element("clip"), " "],
      [element("reset"), " "], [element("tint"), " "], [document.querySelector("summary"), " "],
    ]) {
      control.focus();
      check(document.activeElement === control, `${control.id || control.tagName} can not have the focus`);
      check(!press(key, control), `"${key}" is taken from ${control.id || control.tagName}`);
      pass(20);
      check(!playing() && same(pixels(), still), `"${key}" in ${control.id || control.tagName} reaches the person`);
    }
    element("speed").focus();
    check(press(" ", element("speed")) && playing(), "space does not play beside a slider");
    press(" ");
    document.activeElement.blur();
  }

  function sliders() {
    element("reset").click();
    document.querySelector("details").open = true;
    pass(20);
    layout("with the pose's sliders");
    const still = pixels();
    const all = document.querySelectorAll("#bends input");
    check(all.length === 11, `${all.length} sliders of the pose`);
    for (const slider of all) {
      const label = slider.parentElement.textContent;
      slider.scrollIntoView();
      check(inside(slider), `the slider of ${label} can not be seen`);
      slider.value = 1;
      slider.dispatchEvent(new Event("input"));
      pass(20);
      check(!same(pixels(), still), `the slider of ${label} does not move the person`);
      check(slider.ariaValueText === "57 degrees", `the slider of ${label} says ${slider.ariaValueText}`);
      slider.value = 0;
    }
    element("reset").click();
    pass(20);
    check(same(pixels(), still), "a reset does not bring the pose back");
  }

  /** The page of a person without guessed splats. */
  function without() {
    check(element("guess").hidden && !inside(element("tint")), "what nobody guessed can be tinted");
    pass(20);
    check(covered(pixels()) > 0, "nobody is drawn without guesses");
  }

  /** The page of a person whose first half of splats is guessed. */
  function tint() {
    const still = pixels();
    check(!element("guess").hidden, "what is guessed can not be tinted");
    check(element("share").textContent === "(50 %)", `a share of ${element("share").textContent}`);
    element("tint").click();
    pass(20);
    const tinted = pixels();
    // By the green of the pixels, which the tint has little of. What is seen keeps its colour.
    const changed = tinted.filter((value, i) => i % 4 === 1 && value !== still[i]).length;
    const all = covered(still);
    check(changed > all / 10 && changed < all, `a tint changes ${changed} of ${all} pixels`);
    element("tint").click();
    pass(20);
    check(same(pixels(), still), "without a tint the person looks otherwise than before");
  }

  addEventListener("load", () => {
    let picture = "";
    try {
      check(innerWidth === 390 && innerHeight === 844, `a window of ${innerWidth} x ${innerHeight}`);
      if (GUESSED) {
        layout("at first");
        keys();
        focus();
        sliders();
        tint();
      } else {
        without();
      }
      yoto.hold(...HOLD);
      picture = element("view").toDataURL();
    } catch (error) {
      faults.push(String(error.stack));
    }
    parent.document.body.dataset.found = btoa(JSON.stringify({ faults, picture }));
  });
})();
