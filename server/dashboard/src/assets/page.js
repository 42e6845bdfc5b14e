// Keeps a page that stays open like the service: it listens to events, asks for its own document again after a change, and
// takes over what is different. Nothing is kept from one change to the next, so that a page may stay open for days.
"use strict";
(() => {
  const meta = (name, of = document) => of.querySelector(`meta[name="${name}"]`)?.content ?? "";
  const build = meta("yoto-build");
  const events = meta("yoto-events");
  const live = document.getElementById("live");
  const notice = document.getElementById("notice");
  if (!events) return;

  // Milliseconds: shortest time between two looks at the service, longest silence of it, and longest pause after failures.
  const OFTEN = 1000, SILENCE = 40000, PAUSE = 30000;
  let source, last = "", failures = 0, comeback = 0, watchdog = 0;
  let looking = false, leaving = false, wanted = 0, looked = Date.now();

  const say = (state, words = "") => {
    live.hidden = false;
    live.className = state;
    live.textContent = state === "on" ? "live" : "not connected";
    if (notice.textContent !== words) notice.textContent = words;
    notice.hidden = !words;
  };

  // Makes `old` like `fresh`, and keeps what is equal: focus, scroll positions and pictures stay.
  const take = (old, fresh) => {
    if (old.nodeType !== fresh.nodeType || old.nodeName !== fresh.nodeName || old.id !== fresh.id) {
      old.replaceWith(document.importNode(fresh, true));
      return;
    }
    if (old.nodeType !== Node.ELEMENT_NODE) {
      if (old.nodeValue !== fresh.nodeValue) old.nodeValue = fresh.nodeValue;
      return;
    }
    // A form with a script of its own is that script's.
    if (old.hasAttribute("data-own")) return;
    // Whether details are open is up to the reader, here and now.
    const own = (name) => name === "open" && old.nodeName === "DETAILS";
    for (const { name } of [...old.attributes]) {
      if (!fresh.hasAttribute(name) && !own(name)) old.removeAttribute(name);
    }
    for (const { name, value } of fresh.attributes) {
      if (old.getAttribute(name) !== value && !own(name)) old.setAttribute(name, value);
    }
    const [before, after] = [[...old.childNodes], [...fresh.childNodes]];
    after.forEach((node, at) => {
      if (at < before.length) take(before[at], node);
      else old.append(document.importNode(node, true));
    });
    before.slice(after.length).forEach((node) => node.remove());
  };

  const written = () => document.querySelector("[data-busy]")
    || [...document.querySelectorAll("input:not([type=hidden]), textarea")].some((it) => it.value !== it.defaultValue);

  // A page of another version of the service begins anew, but not again and again where several versions answer in turn.
  const renew = () => {
    const before = Number(sessionStorage.getItem("renewed") ?? 0);
    if (written() || Date.now() - before < 60000) return;
    sessionStorage.setItem("renewed", String(Date.now()));
    location.reload();
  };

  const look = async () => {
    wanted = 0;
    looking = true;
    try {
      const answer = await fetch(location.href, { cache: "no-store", signal: AbortSignal.timeout(20000) });
      // The session has ended: the page for signing in takes the place of this one, unless something is written in it.
      if (leaving) return;
      if (answer.status === 401 && !written()) return location.reload();
      const fresh = new DOMParser().parseFromString(await answer.text(), "text/html");
      if (!meta("yoto-build", fresh)) return;
      if (meta("yoto-build", fresh) !== build) return renew();
      // What was deleted, or is refused for a moment, leaves the page as it was, and says so.
      if (answer.ok) {
        take(document.querySelector("main"), fresh.querySelector("main"));
        document.title = fresh.title;
        say("on");
      } else {
        say(answer.status === 401 ? "off" : "on", fresh.querySelector(".message")?.textContent ?? answer.statusText);
      }
    } catch {
      // The stream tells whether the service is there.
    } finally {
      looked = Date.now();
      looking = false;
    }
  };

  // Looks soon, but not too often: changes that come meanwhile are seen by the same look.
  const want = () => {
    if (wanted || document.hidden) return;
    wanted = setTimeout(() => {
      wanted = 0;
      if (looking) want();
      else look();
    }, Math.max(50, looked + OFTEN - Date.now()));
  };

  const close = () => {
    clearTimeout(comeback);
    clearTimeout(watchdog);
    source?.close();
    source = undefined;
  };

  const lost = () => {
    close();
    failures += 1;
    if (failures === 1 && !looking && !document.hidden) look();
    const since = new Date(looked).toLocaleTimeString();
    if (failures > 1) say("off", `The service does not answer. This page is as of ${since}, and tries again.`);
    else say("off");
    const pause = Math.min(PAUSE, 500 * 2 ** failures) * (0.5 + Math.random());
    comeback = setTimeout(listen, pause);
  };

  const heard = () => {
    clearTimeout(watchdog);
    watchdog = setTimeout(lost, SILENCE);
  };

  const listen = () => {
    close();
    heard();
    source = new EventSource(`${events}&after=${encodeURIComponent(last)}`);
    source.addEventListener("hello", ({ data }) => {
      heard();
      failures = 0;
      say("on");
      if (data !== build) renew();
      want();
    });
    source.addEventListener("change", ({ lastEventId }) => {
      heard();
      last = lastEventId;
      want();
    });
    source.addEventListener("tick", () => {
      heard();
      want();
    });
    source.addEventListener("error", lost);
  };

  // The camera of a player in the page becomes that of the film that is being ordered.
  addEventListener("message", ({ data, source }) => {
    const film = document.querySelector("#film[open] form");
    const own = [...document.querySelectorAll("iframe.player")].some((it) => it.contentWindow === source);
    if (!film || !own || data?.yoto !== "camera") return;
    for (const name of ["azimuth", "elevation"]) {
      const field = film.elements[name];
      if (Number.isFinite(data[name])) field.value = Math.min(field.max, Math.max(field.min, Math.round(data[name])));
    }
  });

  // A form leads to another page, which a reload of this one would keep from coming.
  addEventListener("submit", (event) => {
    leaving = !event.defaultPrevented;
    if (leaving) close();
  });

  // A page that nobody sees keeps no connection: browsers have only a few for one service.
  document.addEventListener("visibilitychange", () => {
    if (document.hidden) close();
    else listen();
  });
  if (!document.hidden) listen();
})();
