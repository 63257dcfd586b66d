/** Leaf through a long list. */

import { fill, h } from "./dom";

/** Show which rows of how many are seen, and a button to each side where there are more. */
export function pager(place: Element, total: number, after: number, rows: number, go: (after: number) => void): void {
  if (total <= rows && !after) {
    fill(place);
    return;
  }
  const button = (words: string, label: string, next: number, there: boolean) =>
    h("button", { "aria-label": label, "aria-disabled": String(!there), onclick: () => there && go(next) }, words);
  fill(
    place,
    button("‹", "Newer flights", Math.max(0, after - rows), after > 0),
    `${after + 1} to ${Math.min(total, after + rows)} of ${total}`,
    button("›", "Older flights", after + rows, after + rows < total),
  );
}
