import { defineConfig } from "vite";

// Everything is bundled; the page requests data from its own server only.
export default defineConfig({
  base: "/",
  build: {
    outDir: "../src/uavrt/ground/static",
    emptyOutDir: true,
    assetsInlineLimit: 0,
    chunkSizeWarningLimit: 1500,
    sourcemap: false,
  },
  worker: { format: "es" },
});
