// The controls of a page that plays one person.
(() => {
  const element = (id) => document.getElementById(id);
  const person = JSON.parse(element("person").textContent);
  let player;
  try {
    player = createPlayer(element("view"), person);
  } catch (error) {
    element("trouble").textContent = error.message;
    element("trouble").hidden = false;
    return;
  }
  const { state, change, home, times } = player;
  for (const [i, clip] of player.clips.entries()) element("clip").add(new Option(clip.name, i));
  element("clip").onchange = (event) => change({ clip: Number(event.target.value), time: 0 });
  element("speed").oninput = ({ target }) => {
    change({ speed: Number(target.value) });
    target.ariaValueText = `${target.value} times`;
  };
  function play(playing) {
    change({ playing });
    element("play").textContent = playing ? "Pause" : "Play";
  }
  element("play").onclick = () => play(!state.playing);
  element("reset").onclick = () => {
    for (const [, slider] of sliders) slider.value = 0;
    change(home);
    bend();
  };

  element("guess").hidden = player.guessed === 0;
  element("share").textContent = `(${Math.round(100 * player.guessed)} %)`;
  element("tint").onchange = ({ target }) => change({ tinted: target.checked });

  const [X, Y, Z] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  const minus = (v) => v.map((x) => -x);
  // Fingers bend towards the palm, which faces down in the rest pose.
  const fingers = (side, axis) =>
    Object.fromEntries(
      ["index", "middle", "ring", "pinky"].flatMap((finger) =>
        [1, 2, 3].map((joint) => [`${side}_${finger}${joint}`, axis]),
      ),
    );
  // A label, the joints that it bends about their axes, the share of the angle that each gets (an equal one by default), and the least angle.
  const groups = [
    ["Head", { neck: Y, head: Y }],
    ["Torso, turn", { spine1: Y, spine2: Y, spine3: Y }],
    ["Torso, bend", { spine1: X, spine2: X, spine3: X }],
    ["Left arm", { l_shoulder: Z }],
    ["Right arm", { r_shoulder: minus(Z) }],
    ["Left elbow", { l_elbow: minus(Y) }],
    ["Right elbow", { r_elbow: Y }],
    ["Left leg", { l_hip: minus(X) }],
    ["Right leg", { r_hip: minus(X) }],
    ["Left knee", { l_knee: X }],
    ["Right knee", { r_knee: X }],
    ["Left fingers", fingers("l", minus(Z)), 1],
    ["Right fingers", fingers("r", Z), 1],
    ["Mouth", { jaw: X }, 0.3, 0],
    ["Eyelids", { l_eyelid: X, r_eyelid: X }, 0.4, 0],
  ];
  const sliders = [];
  function bend() {
    const bends = {};
    for (const [members, slider, share] of sliders) {
      slider.ariaValueText = `${Math.round((180 / Math.PI) * slider.value)} degrees`;
      const half = (Number(slider.value) / 2) * share;
      for (const [name, axis] of Object.entries(members)) {
        const joint = person.joints.indexOf(name);
        const q = [Math.cos(half), ...axis.map((x) => Math.sin(half) * x)];
        bends[joint] = bends[joint] ? times(bends[joint], q) : q;
      }
    }
    change({ bends });
  }
  for (const [label, members, share = 1 / Object.keys(members).length, min = -1.5] of groups) {
    if (!Object.keys(members).every((name) => person.joints.includes(name))) continue;
    const row = document.createElement("label");
    const slider = Object.assign(document.createElement("input"), {
      type: "range", min, max: 1.5, step: 0.01, value: 0,
      ariaValueText: "0 degrees", oninput: bend,
    });
    sliders.push([members, slider, share]);
    row.append(label, slider);
    element("bends").append(row);
  }
  element("bends").parentElement.hidden = element("bends").childElementCount === 0;

  // Keys of the page, before anything was clicked too. A control that has the focus keeps those that it uses itself.
  const actions = { " ": () => play(!state.playing), ...player.actions };
  const uses = (control, key) => {
    switch (control.tagName) {
      case "SELECT": return true;
      case "BUTTON": case "SUMMARY": return key === " ";
      case "INPUT": return control.type === "checkbox" ? key === " " : key.startsWith("Arrow");
      default: return false;
    }
  };
  document.addEventListener("keydown", (event) => {
    const action = actions[event.key];
    // With these, keys are the browser's.
    const other = event.ctrlKey || event.metaKey || event.altKey;
    if (!action || other || uses(event.target, event.key)) return;
    event.preventDefault();
    // A key that is held turns on, but does not play and pause in turn.
    if (!(event.repeat && event.key === " ")) action();
  });

  // A page around this one can order a film by the camera here: degrees to the right of the person's front, and above the ground.
  if (parent !== window) {
    const degrees = (x) => (180 / Math.PI) * x;
    state.turned = () => {
      const azimuth = degrees(Math.atan2(Math.sin(state.turn), Math.cos(state.turn)));
      parent.postMessage({ yoto: "camera", azimuth, elevation: degrees(state.tilt) }, "*");
    };
  }

  // For scripts.
  window.yoto = { hold: player.hold, release: player.release };
  play(player.clips[0].seconds > 0);
  player.start();
})();
