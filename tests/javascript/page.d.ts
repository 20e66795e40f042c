// What the page's scripts have from elsewhere: the panel's answers, and what its tests may ask.
import type { components } from "./api";

declare global {
  /** The status as the panel tells it, and what the page adds. */
  type PageStatus = components["schemas"]["Status"] & { shown: Record<string, string> };
  // All that is on a page is HTML, and what is pressed is on it.
  interface Element extends HTMLOrSVGElement, ElementCSSInlineStyle {}
  interface EventTarget {
    closest(selectors: string): HTMLElement | null;
  }
  interface Window {
    dx: Record<string, any>;
    dxScene: Record<string, any>;
  }
}
