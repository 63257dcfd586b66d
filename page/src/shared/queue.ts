/** Requests that change the same thing. */

/** They go out one after the other: a slow one neither undoes a later one nor answers after it. */
export class Queue {
  private last: Promise<unknown> = Promise.resolve();
  private waiting = new Map<string, number>();

  add<T>(request: () => Promise<T>, field = ""): Promise<T> {
    this.count(field, 1);
    const done = this.last.then(request).finally(() => this.count(field, -1));
    this.last = done.catch(() => undefined);
    return done;
  }

  /** Whether a field's change is not answered yet: until then the field keeps what was typed. */
  waits(field: string): boolean {
    return (this.waiting.get(field) ?? 0) > 0;
  }

  private count(field: string, step: number): void {
    this.waiting.set(field, (this.waiting.get(field) ?? 0) + step);
  }
}
