// Brightness of what is shown outside of the 3D view.

/** Photos are shown with the same exposure as the model, on linear light. */
export function exposePictures(stops: number): void {
  document.body.dataset.exposed = String(stops !== 0);
  for (const channel of document.querySelectorAll("#exposed [type=linear]")) channel.setAttribute("slope", String(2 ** stops));
}
