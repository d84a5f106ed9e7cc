(() => {
  "use strict";
  const main = document.querySelector("main[data-live]");
  const unanswered = document.getElementById("unanswered");
  let last = "";

  // What the reader has chosen, opened and scrolled outlives the new content.
  const replace = (content) => {
    const chosen = new Set([...main.querySelectorAll("input:checked")].map((box) => box.value));
    const opened = [...main.querySelectorAll("details[open][id]")].map((one) => one.id);
    const scrolled = [...main.querySelectorAll(".scroll")].map((one) => one.scrollLeft);
    const focused = main.contains(document.activeElement) ? document.activeElement.value : undefined;
    main.innerHTML = content;
    for (const box of main.querySelectorAll("input[type=checkbox]")) {
      box.checked = chosen.has(box.value);
      if (focused !== undefined && box.value === focused) box.focus({ preventScroll: true });
    }
    for (const id of opened) document.getElementById(id)?.setAttribute("open", "");
    main.querySelectorAll(".scroll").forEach((one, i) => { one.scrollLeft = scrolled[i] ?? 0; });
  };

  const asked = async (address) => {
    const answer = await fetch(address, { cache: "no-store" });
    if (!answer.ok) throw new Error(await answer.text());
    return answer.text();
  };

  const look = async () => {
    try {
      if (!document.hidden) {
        const text = await asked(main.dataset.live);
        const state = main.dataset.state;
        if (state && JSON.parse(text).state !== state) {
          location.reload();
          return;
        }
        // A finished run is what its page was made of; any other may have gone on since.
        const known = last || (state === "finished" ? text : "");
        if (text !== known) replace(await asked(main.dataset.part));
        last = text;
      }
      unanswered.textContent = "";
    } catch {
      unanswered.textContent = "No answer from `lacuna view`. This page shows what was known before; it goes on asking.";
    }
    setTimeout(look, 2000);
  };
  look();
})();
