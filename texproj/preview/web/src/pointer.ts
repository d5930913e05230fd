// Presses, drags, the wheel and two fingers, on any element.

import type { Vec2 } from "./lens.ts";

const CLICK_PX = 4;
const ZOOM_PER_NOTCH = 1.0015;

/** Position of a pointer on an element. */
export function at(event: MouseEvent, element: Element): Vec2 {
  const box = element.getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
}

/** Call `act` for presses that were not drags. */
export function onClick(element: HTMLElement, act: (at: Vec2, event: PointerEvent) => void): void {
  let down: Vec2 | null = null;
  element.addEventListener("pointerdown", (event) => {
    down = event.button === 0 && event.isPrimary ? [event.clientX, event.clientY] : null;
  });
  element.addEventListener("pointerup", (event) => {
    if (down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < CLICK_PX) act(at(event, element), event);
    down = null;
  });
}

/** Dragging and the wheel move the window of a picture; two fingers zoom. */
export function onPanZoom(
  element: HTMLElement, active: () => boolean,
  act: { pan(dx: number, dy: number): void; zoom(factor: number, at: Vec2): void },
): void {
  const fingers = new Map<number, Vec2>();
  element.addEventListener("pointerdown", (event) => {
    if (active()) fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const now: Vec2 = [event.clientX, event.clientY];
    const others = [...fingers].filter(([id]) => id !== event.pointerId).map(([, p]) => p);
    act.pan((now[0] - before[0]) / fingers.size, (now[1] - before[1]) / fingers.size);
    if (others.length) pinch(before, now, others[0]);
    fingers.set(event.pointerId, now);
  });
  const pinch = (before: Vec2, now: Vec2, other: Vec2) => {
    const box = element.getBoundingClientRect();
    const [was, is] = [Math.hypot(before[0] - other[0], before[1] - other[1]), Math.hypot(now[0] - other[0], now[1] - other[1])];
    act.zoom(is / Math.max(was, 1), [(now[0] + other[0]) / 2 - box.left, (now[1] + other[1]) / 2 - box.top]);
  };
  for (const kind of ["pointerup", "pointercancel"] as const) {
    addEventListener(kind, (event) => fingers.delete(event.pointerId));
  }
  element.addEventListener("wheel", (event) => {
    if (!active()) return;
    event.preventDefault();
    act.zoom(ZOOM_PER_NOTCH ** -event.deltaY, at(event, element));
  }, { passive: false });
}
