// The editor of programs: CodeMirror with the reader's refusals in line, and what is changed against what is stored.
import { defaultKeymap, history, historyKeymap } from "../vendor/codemirror.commands.js";
import { HighlightStyle, StreamLanguage, syntaxHighlighting } from "../vendor/codemirror.language.js";
import { tags } from "../vendor/codemirror.lezer-highlight.js";
import { lintGutter, setDiagnostics } from "../vendor/codemirror.lint.js";
import { unifiedMergeView } from "../vendor/codemirror.merge.js";
import { Compartment, EditorState } from "../vendor/codemirror.state.js";
import { EditorView, drawSelection, highlightActiveLine, highlightActiveLineGutter, keymap, lineNumbers } from "../vendor/codemirror.view.js";

const WORDS = [
  [/^;.*/, "comment"],
  [/^\([^)]*\)?/, "comment"],
  [/^o\s*(<[^>]*>|\d+)?\s*[a-z]*/i, "keyword"],
  [/^[gm]\s*\d+(\.\d+)?/i, "keyword"],
  [/^#\s*(<[^>]*>|\d+)/, "variableName"],
  [/^[nf]\s*[-+]?[\d.]+/i, "meta"],
  [/^[a-z]/i, "propertyName"],
  [/^[-+]?[\d.]+/, "number"],
];

function token(stream) {
  if (stream.eatSpace()) return null;
  const found = WORDS.find(([sign]) => stream.match(sign));
  if (!found) stream.next();
  return found?.[1] ?? null;
}

const program = StreamLanguage.define({ name: "program", token });
const colours = HighlightStyle.define([
  { tag: tags.comment, color: "var(--dim)", fontStyle: "italic" },
  { tag: tags.keyword, color: "var(--accent)", fontWeight: "700" },
  { tag: tags.propertyName, color: "var(--go)" },
  { tag: [tags.variableName, tags.meta], color: "var(--hold)" },
]);

// All colours are the page's own, so that they turn with its theme.
const look = EditorView.theme({
  "&": { height: "100%", color: "var(--text)", backgroundColor: "var(--bg)", fontSize: "1rem" },
  "&.cm-focused": { outline: "2px solid var(--accent)" },
  ".cm-scroller": { fontFamily: '"DejaVu Sans Mono", "Roboto Mono", monospace', lineHeight: "1.6" },
  ".cm-content": { caretColor: "var(--text)" },
  ".cm-cursor": { borderLeftColor: "var(--text)" },
  ".cm-gutters": { backgroundColor: "var(--card)", color: "var(--dim)", borderRight: "1px solid var(--line)" },
  ".cm-activeLine, .cm-activeLineGutter": { backgroundColor: "color-mix(in srgb, var(--accent) 12%, transparent)" },
  "&.cm-focused > .cm-scroller > .cm-selectionLayer .cm-selectionBackground, .cm-selectionBackground": { backgroundColor: "color-mix(in srgb, var(--accent) 35%, transparent)" },
  ".cm-lintRange-error": { backgroundImage: "none", borderBottom: "3px solid var(--stop-fill)", backgroundColor: "color-mix(in srgb, var(--stop-fill) 22%, transparent)" },
  ".cm-tooltip": { backgroundColor: "var(--card)", color: "var(--text)", border: "1px solid var(--line)", maxWidth: "40rem" },
  ".cm-changedLine, .cm-insertedLine": { backgroundColor: "color-mix(in srgb, var(--go-fill) 18%, transparent) !important" },
  ".cm-deletedChunk": { backgroundColor: "color-mix(in srgb, var(--stop-fill) 14%, transparent)", color: "var(--text)" },
});

export class Area {
  // ``place``: an element; ``changed`` is called with every change of the text, ``moved`` of the caret's place.
  constructor(place, text, label, changed, moved) {
    this.stored = text;
    this.beside = new Compartment();
    const heard = EditorView.updateListener.of((update) => (update.docChanged ? changed() : update.selectionSet && moved()));
    const parts = [
      ...[lineNumbers(), history(), drawSelection(), highlightActiveLine(), highlightActiveLineGutter(), lintGutter()],
      ...[program, syntaxHighlighting(colours), look, heard, this.beside.of([])],
      ...[keymap.of([...defaultKeymap, ...historyKeymap]), EditorView.contentAttributes.of({ "aria-label": label })],
    ];
    // In a root of its own its styles are sheets, not elements, which the page's policy would not take.
    const root = place.shadowRoot ?? place.attachShadow({ mode: "open" });
    this.view = new EditorView({ state: EditorState.create({ doc: text, extensions: parts }), parent: root, root });
    this.view.focus();
  }

  get text() {
    return this.view.state.doc.toString();
  }

  // The caret's line and those above it, the nearest first.
  *above(most) {
    const { doc, selection } = this.view.state;
    const last = doc.lineAt(selection.main.head).number;
    for (let n = last; n > Math.max(0, last - most); n--) yield doc.line(n).text;
  }

  // Refusals, { line, column, sentence }, each under its word.
  mark(refusals) {
    const { doc } = this.view.state;
    const found = refusals.filter(({ line }) => line >= 1 && line <= doc.lines).map(({ line, column, sentence }) => {
      const row = doc.line(line);
      const from = Math.min(row.to, row.from + Math.max(0, column - 1));
      const word = /^\S*/.exec(doc.sliceString(from, row.to))[0];
      return { from, to: Math.max(from, from + word.length), severity: "error", message: sentence };
    });
    this.view.dispatch(setDiagnostics(this.view.state, found));
  }

  go({ line, column }) {
    const row = this.view.state.doc.line(Math.min(line, this.view.state.doc.lines));
    const at = Math.min(row.to, row.from + Math.max(0, column - 1));
    this.view.dispatch({ selection: { anchor: at }, effects: EditorView.scrollIntoView(at, { y: "center" }) });
    this.view.focus();
  }

  // What is deleted and put in, line by line; or the text alone.
  compare(on) {
    const shown = on ? unifiedMergeView({ original: this.stored, mergeControls: false, gutter: true }) : [];
    this.view.dispatch({ effects: this.beside.reconfigure(shown) });
  }

  end() {
    this.view.destroy();
  }
}
