// Draw the diagrams of a page, which are blocks of Mermaid as forges draw them, too. The site carries
// Mermaid's own script: of Knut Sveidqvist and others, under the MIT licence.
const { theme } = document.body.dataset;
const isDark = theme === "auto" ? matchMedia("(prefers-color-scheme: dark)").matches : theme === "dark";
const diagrams = document.querySelectorAll(".highlight-mermaid pre");
for (const diagram of diagrams) diagram.textContent = diagram.textContent; // without marks of syntax
mermaid.initialize({ startOnLoad: false, theme: isDark ? "dark" : "neutral" });
mermaid.run({ nodes: diagrams });
