/** Maps of where a tag is detected: requested until they are ready, with a summary in words. */

import { ApiError, reasonOf, send } from "../shared/api";
import { by, fill, h, say } from "../shared/dom";
import { fixed, percent } from "../shared/format";
import { fromServer, t, verbatim, type Words } from "../shared/i18n";
import type { HeardMap, MapAnswer } from "../types";

const AGAIN_MS = 700;

/** How far a map is, and why there is none; the ids begin with its name. */
export function coverageElements(name: string): HTMLElement[] {
  return [
    h("progress", { id: `${name}-progress`, max: "1", value: "0", hidden: true, "aria-label": t("heard.progress") }),
    h("p", { id: `${name}-fault`, class: "fault-line", role: "alert" }),
  ];
}

/** Clear the summary. */
export function discardCoverageMap(name: string): void {
  by(`${name}-progress`).hidden = true;
  say(by(`${name}-fault`), "");
  fill(by(`${name}-status`));
}

/** Ask until the map is there; null where it cannot be made, or is wanted no longer. */
export async function askForMap<Made extends HeardMap>(name: string, path: string, question: object, wanted: () => boolean): Promise<Made | null> {
  const bar = by(`${name}-progress`) as HTMLProgressElement;
  say(by(`${name}-fault`), "");
  bar.hidden = false;
  bar.value = 0;
  let made: Made | null = null;
  try {
    for (let again = false; ; again = true) {
      const answer = await send<MapAnswer<Made>>("POST", path, { ...question, again });
      if (!wanted()) return null;
      if (answer.state === "failed") throw new ApiError(fromServer(answer.error), 500);
      if (answer.state === "done") {
        made = answer;
        break;
      }
      bar.value = answer.done;
      await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
      if (!wanted()) return null;
    }
  } catch (error) {
    if (!wanted()) return null;
    say(by(`${name}-fault`), reasonOf(error));
  }
  bar.hidden = true;
  return made;
}

/** Say what a map shows, below its colours; notes, then what it does not hold for. */
export function showCoverageSummary(name: string, map: HeardMap, notes: Words[]): void {
  const shareOf = (value: number | null) => (value === null ? t("heard.unknown") : percent(value));
  fill(
    by(`${name}-status`),
    h("div", { class: "ramp heard-ramp", role: "img", "aria-label": t("heard.ramp") }),
    h(
      "p",
      {},
      h("span", {}, t("heard.summary", { mean: shareOf(map.mean_probability), share: shareOf(map.share_above_90), area: fixed(map.known_km2, 1) })),
      verbatim(" "),
      h("span", {}, t("heard.colours")),
    ),
    ...[...notes, ...map.limitations.map(fromServer)].map((words) => h("p", { class: "note" }, words)),
  );
}
