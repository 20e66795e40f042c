// The page's words, in the language it speaks: the panel's catalogue, fetched once.
import { dx } from "./store.js";

export async function learn(language) {
  const answer = await fetch(`/page/texts/${language}.json`);
  dx.words = await answer.json();
}

// The text of a key, with its {0}, {1} ... filled in; what has none is shown as it is.
export const word = (key, ...values) =>
  values.reduce((text, value, i) => text.replaceAll(`{${i}}`, () => value), dx.words[key] ?? key);

// The text of a key where there is one.
export const known = (key, otherwise = "") => dx.words[key] ?? otherwise;

// Of an answer or a fault: the panel says it in the page's language.
export const sentence = (facts) => facts?.sentence ?? "";

// The languages that there are, by their codes.
export const languages = () =>
  Object.keys(dx.words).flatMap((key) => (key.startsWith("language.") ? [key.slice("language.".length)] : []));
