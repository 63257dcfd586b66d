/**
 * A smooth pan where no graphics processor helps: while the map moves it is drawn coarser, as
 * coarse as its frames are slow, and sharp again as soon as it rests.
 *
 * Without a graphics processor the time of a frame depends on the number of pixels, whatever is
 * on them: half the resolution of an empty map of 734 × 513 takes 17 ms instead of 33 (SwiftShader, 2 cores).
 */

import type { Map as MapLibre } from "maplibre-gl";

/** Shares of the full resolution, tried in this order. */
const STEPS = [1, 0.7, 0.5, 0.35, 0.25];
/** The median of the last frames above this makes the map coarser; a frame of 60 Hz is 16.7, two are 33.3. */
const SLOW_MS = 20;
const FRAMES = 4;
/** Longer ones are pauses, of a hidden tab for example. */
const PAUSE_MS = 500;
const REST_MS = 220;

export class Pace {
  /** Kept from one move to the next: the computer stays what it is. */
  private step = 0;
  private moving = false;
  private resizing = false;
  private movedAt = -Infinity;
  private frames: number[] = [];

  constructor(
    private map: MapLibre,
    private full: number,
  ) {
    map.on("move", () => {
      if (this.resizing) return;
      const before = this.movedAt;
      this.movedAt = performance.now();
      // One step alone is a jump, for example to a flight that has been opened.
      if (!this.moving && this.movedAt - before < REST_MS) this.begin();
    });
  }

  /** Share of the full resolution that is drawn now. */
  get share(): number {
    return this.map.getPixelRatio() / this.full;
  }

  private begin(): void {
    this.moving = true;
    this.frames = [];
    let last = performance.now();
    let coarse = false;
    const watch = (now: number) => {
      if (now - this.movedAt > REST_MS) {
        this.moving = false;
        this.draw(1);
        return;
      }
      // Not before: MapLibre may be telling of the move from within the drawing of a frame.
      if (!coarse) this.draw(STEPS[this.step]!);
      coarse = true;
      this.take(now - last);
      last = now;
      requestAnimationFrame(watch);
    };
    requestAnimationFrame(watch);
  }

  private take(frameMs: number): void {
    if (frameMs <= 0 || frameMs > PAUSE_MS) return;
    this.frames.push(frameMs);
    if (this.frames.length < FRAMES) return;
    const middle = [...this.frames].sort((a, b) => a - b)[FRAMES >> 1]!;
    this.frames = [];
    if (middle > SLOW_MS && this.step < STEPS.length - 1) {
      this.step += 1;
      this.draw(STEPS[this.step]!);
    }
  }

  private draw(share: number): void {
    const ratio = share * this.full;
    if (this.map.getPixelRatio() === ratio) return;
    // MapLibre reports a new size as a move; it empties the canvas, so draw at once.
    this.resizing = true;
    this.map.setPixelRatio(ratio);
    this.map.redraw();
    this.resizing = false;
  }
}
