/// <reference types="vitest/config" />
import { defineConfig } from "vite";

export default defineConfig({
  base: "./", // a proxy may offer the page below a prefix
  resolve: { tsconfigPaths: true }, // the client is its sources
  build: {
    target: "es2022",
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    license: { fileName: "licences.md" }, // of the packages that it contains
    chunkSizeWarningLimit: 1600, // the reference of the interface; the page itself is half as large
    rolldownOptions: { input: ["index.html", "docs.html"] },
  },
  worker: { format: "es" },
  server: { proxy: { "/v1": "http://127.0.0.1:8000" } },
  test: {
    include: ["tests/**/*.test.ts"],
    setupFiles: ["tests/support/setup.ts"],
    isolate: false, // starting a worker for each file takes longer than its tests
  },
});
