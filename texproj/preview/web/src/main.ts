// Starts the page and keeps it in step with the server.

import "./style.css";
import * as api from "./api.ts";
import { App } from "./app.ts";
import { byId } from "./dom.ts";
import { connect } from "./gestures.ts";
import * as lens from "./lens.ts";
import { MADE, MAKING, tabTitle } from "./jobwords.ts";
import { showSettings } from "./settings.ts";
import { hideJob, notice, runningJob, showJob } from "./notice.ts";

const app = new App();
connect(app);

let lost = false;

api.listen({
  hello() {
    if (lost) notice("");
    lost = false;
    document.body.dataset.online = "true";
    hideJob();
    void app.refresh().then(() => {
      for (const job of app.facts?.jobs ?? []) showJob(job);
      return app.picking.resume();
    });
  },
  lost() {
    lost = true;
    document.body.dataset.online = "false";
    notice("The server does not answer. Your work is kept here and saved when it is back.", "bad", false);
  },
  job(job) {
    showJob(job);
    title(false);
    if (job.state === "done" && MADE.includes(job.kind)) void app.madeModel(job).then(() => title(!document.hasFocus()));
    else if (job.state === "done" && job.kind === "appearance") void app.refresh().then(() => app.setLayer("base")).then(() => app.told(job));
    else if (job.state === "done" && MAKING.includes(job.kind)) void app.refresh().then(() => app.told(job));
    else if (job.state !== "running") app.show();
    app.picking.onJob(job);
  },
  files(changed) {
    if (changed.some((file) => file.startsWith("work/"))) void app.places.load().then(() => app.show());
    if (changed.every((file) => file.startsWith("work/"))) return;
    app.picking.onFiles(changed);
    app.masks.onFiles(changed);
    void app.refresh();
  },
  light() {
    void app.loadLight();
  },
});

for (const kind of ["run", "register", "color", "appearance"]) {
  byId(`do-${kind}`).addEventListener("click", () => void app.start(kind));
}
for (const button of byId("stages").querySelectorAll("button")) {
  button.addEventListener("click", () => byId("stages").hidePopover());
}
byId("do-settings").addEventListener("click", () => {
  showSettings(() => void app.refresh()).catch((error: unknown) => app.complain(error));
});
addEventListener("focus", () => title(false));

/** The tab tells how far the work is, and that it is done while nobody looked. */
function title(done: boolean): void {
  document.title = tabTitle(app.facts?.name ?? "texproj", runningJob(), done);
}

for (const tab of document.querySelectorAll<HTMLButtonElement>("#tabs button")) {
  tab.addEventListener("click", () => {
    document.body.dataset.sheet = tab.dataset.sheet;
    for (const other of document.querySelectorAll("#tabs button")) {
      other.setAttribute("aria-pressed", String(other === tab));
    }
  });
}

declare global {
  interface Window {
    /** For tests and the curious. */
    texproj: App & { lens: typeof lens };
  }
}
window.texproj = Object.assign(app, { lens });
