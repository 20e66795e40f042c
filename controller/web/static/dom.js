// What views are written with: templates that become elements.
import { h } from "./vendor/preact.js";
import htm from "./vendor/htm.js";

export { Component, createRef, render } from "./vendor/preact.js";
export { useEffect, useLayoutEffect, useRef, useState } from "./vendor/hooks.js";
export const html = htm.bind(h);
