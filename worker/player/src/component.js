// <yoto-avatar src="ada.html">: plays the person of an exported page, or of a link that other sites may show, in a page of
// one's own. Attributes say the clip, the speed, the camera, the light and the background; methods set poses; events tell
// what happens.
class YotoAvatar extends HTMLElement {
  static observedAttributes = ["src", "clip", "speed", "paused", "turn", "tilt", "distance", "light", "background", "label"];

  #canvas;
  #words;
  #player = null;
  #loading = null;
  #watch = null;

  constructor() {
    super();
    const root = this.attachShadow({ mode: "open" });
    const style = new CSSStyleSheet();
    style.replaceSync(`
      :host { display: inline-block; position: relative; width: 20rem; height: 30rem; }
      :host([hidden]) { display: none; }
      canvas { width: 100%; height: 100%; display: block; touch-action: none; cursor: grab; }
      canvas:focus-visible { outline: 2px solid Highlight; outline-offset: -2px; }
      p { position: absolute; inset: 0; margin: auto; height: fit-content; padding: 1rem; text-align: center; }
      p:empty { display: none; }
    `);
    root.adoptedStyleSheets = [style];
    this.#canvas = document.createElement("canvas");
    Object.assign(this.#canvas, { tabIndex: 0, role: "img" });
    this.#words = document.createElement("p");
    this.#words.role = "status";
    root.append(this.#canvas, this.#words);
    this.#canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  connectedCallback() {
    this.#watch = new IntersectionObserver(([entry]) => {
      if (entry.isIntersecting) this.#player?.start();
      else this.#player?.stop();
    });
    this.#watch.observe(this);
    if (!this.#player) this.#load();
  }

  disconnectedCallback() {
    this.#watch?.disconnect();
    this.#loading?.abort();
    this.#player?.end();
    this.#player = null;
    // The context of a canvas can't be made again.
    const canvas = this.#canvas.cloneNode();
    this.#canvas.replaceWith(canvas);
    this.#canvas = canvas;
    this.#canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  attributeChangedCallback(name, before, now) {
    if (before === now || !this.isConnected) return;
    if (name === "src") this.#again();
    else this.#apply(name);
  }

  /** The names of the person's clips; empty until the event `ready`. */
  get clips() {
    return (this.#player?.clips ?? []).map((clip) => clip.name);
  }

  /** The names of the person's joints; empty until the event `ready`. */
  get joints() {
    return this.#player?.person.joints ?? [];
  }

  /** The time in the clip, seconds. */
  get currentTime() {
    return this.#player?.state.time ?? 0;
  }

  set currentTime(time) {
    if (Number.isFinite(time)) this.#player?.change({ time: Math.max(0, time) });
  }

  play() {
    this.toggleAttribute("paused", false);
    this.#player?.change({ playing: true, pose: null });
  }

  pause() {
    this.toggleAttribute("paused", true);
  }

  /**
   * Holds a pose in place of the clip, until `releasePose()`. `rotations`: of joints by their names, axis times angle in
   * radians, from the rest pose, relative to the joint before; `shift`: of the root, metres.
   */
  setPose(rotations, shift) {
    if (!this.#player) throw new Error("the person is not there yet: wait for the event ready");
    this.#player.pose(rotations, shift);
  }

  releasePose() {
    this.#player?.change({ pose: null });
  }

  #again() {
    this.disconnectedCallback();
    this.connectedCallback();
  }

  async #load() {
    const src = this.getAttribute("src");
    if (!src) return;
    const loading = (this.#loading = new AbortController());
    this.#words.textContent = "";
    try {
      const answer = await fetch(src, { signal: loading.signal });
      if (!answer.ok) throw new Error(`the person can't be had: ${src} answers ${answer.status}`);
      const page = new DOMParser().parseFromString(await answer.text(), "text/html");
      const data = page.getElementById("person");
      if (!data) throw new Error(`${src} is no page of a person`);
      const person = JSON.parse(data.textContent);
      if (loading.signal.aborted) return;
      this.#player = createPlayer(this.#canvas, person);
      this.#canvas.ariaLabel = this.getAttribute("label") ?? page.title;
      this.#player.state.looped = () => this.#tell("loop");
      const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
      if (still) this.toggleAttribute("paused", true);
      this.#apply();
      this.#player.start();
      this.#tell("ready");
    } catch (error) {
      if (loading.signal.aborted) return;
      this.#words.textContent = error.message;
      this.#tell("error", { message: error.message });
    }
  }

  /** Does what the attributes say: all of them, or the one called `only`, so that the camera of a drag stays. */
  #apply(only) {
    if (!this.#player) return;
    const { clips, home, state, change } = this.#player;
    const number = (name, otherwise) => {
      const value = Number.parseFloat(this.getAttribute(name));
      return Number.isFinite(value) ? value : otherwise;
    };
    const degrees = Math.PI / 180;
    const changes = {
      clip: () => {
        const clip = Math.max(clips.findIndex((it) => it.name === this.getAttribute("clip")), 0);
        return { clip, time: clip === state.clip ? state.time : 0 };
      },
      paused: () => ({ playing: !this.hasAttribute("paused") }),
      speed: () => ({ speed: number("speed", 1) }),
      light: () => ({ light: number("light", 1) }),
      turn: () => ({ turn: number("turn", home.turn / degrees) * degrees }),
      tilt: () => ({ tilt: number("tilt", home.tilt / degrees) * degrees }),
      distance: () => ({ distance: Math.min(12, Math.max(0.6, number("distance", home.distance))) }),
    };
    for (const [name, values] of Object.entries(changes)) {
      if (!only || name === only) change(values());
    }
    this.style.background = this.getAttribute("background") ?? "";
    if (this.hasAttribute("label")) this.#canvas.ariaLabel = this.getAttribute("label");
  }

  #key(event) {
    const action = this.#player?.actions[event.key];
    const other = event.ctrlKey || event.metaKey || event.altKey;
    if (other || !(action || event.key === " ")) return;
    event.preventDefault();
    if (action) action();
    else if (!event.repeat) this.toggleAttribute("paused");
  }

  #tell(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }
}
customElements.define("yoto-avatar", YotoAvatar);
