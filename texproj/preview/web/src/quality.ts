// How finely the view is drawn: coarse while a slow machine moves, fine when it rests.

/** The view counts as moving until so long after the last change. */
export const SETTLE_MS = 160;
/** Stillness after which the view is drawn fine. */
const POLISH_MS = 700;
/** Frames slower than this while moving bring in the light mesh. */
const SLOW_FRAME_MS = 45;

/** Pixels drawn per pixel shown, along an edge: moving on a slow machine, moving, still. */
export const COARSE = 0.5;
export const PLAIN = 1;
export const FINE = 2;

/** Tells the quality for each frame; once full frames prove slow while moving, it stays coarse then. */
export class Quality {
  private slow = false;
  private lastFrame = 0;
  private wasMoving = false;

  /** For the frame at `now`, of a view that changed last at `movedAt`, both in ms. */
  at(now: number, movedAt: number): number {
    const moving = now - movedAt < SETTLE_MS;
    if (moving && this.wasMoving && now - this.lastFrame > SLOW_FRAME_MS) this.slow = true;
    this.lastFrame = now;
    this.wasMoving = moving;
    if (moving) return this.slow ? COARSE : PLAIN;
    return now - movedAt < POLISH_MS ? PLAIN : FINE;
  }
}
