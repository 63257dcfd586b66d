/** Leaf through a long list. */

import { fill, h } from "./dom";
import { t, verbatim, type Words } from "./i18n";

/** Show which rows of how many are seen, and a button to each side where there are more. */
export function pager(place: Element, total: number, after: number, rows: number, go: (after: number) => void): void {
  if (total <= rows && !after) {
    fill(place);
    return;
  }
  const button = (sign: string, label: Words, next: number, there: boolean) =>
    h("button", { "aria-label": label, "aria-disabled": String(!there), onclick: () => there && go(next) }, verbatim(sign));
  fill(
    place,
    button("‹", t("pager.newer_flights"), Math.max(0, after - rows), after > 0),
    t("pager.rows", { first: after + 1, last: Math.min(total, after + rows), total }),
    button("›", t("pager.older_flights"), after + rows, after + rows < total),
  );
}
