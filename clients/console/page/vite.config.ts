import {defineConfig} from 'vitest/config';

export default defineConfig({
  base: './',
  esbuild: {jsx: 'automatic', jsxImportSource: 'preact'},
  build: {
    target: 'es2022',
    // three.js is a part of its own, which is loaded when the 3-D view first shows.
    chunkSizeWarningLimit: 800,
    modulePreload: {polyfill: false},
  },
  test: {include: ['tests/**/*.test.ts'], environment: 'node'},
});
