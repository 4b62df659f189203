// Bundles src/ and three.js into the one script that planish puts into its pages: node build.mjs [FILE]
import { createHash } from "node:crypto";
import { readFileSync, readdirSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const made = process.argv[2] ?? join(here, "..", "static", "view.js");

const modules = readdirSync(join(here, "src")).sort();
const sources = ["package-lock.json", "tsconfig.json", "build.mjs", ...modules.map((name) => `src/${name}`)];
const digest = createHash("sha256");
for (const name of sources) digest.update(readFileSync(join(here, name)));

const licence = readFileSync(join(here, "node_modules", "three", "LICENSE"), "utf8").trim();
await build({
  entryPoints: [join(here, "src", "main.ts")],
  outfile: made,
  bundle: true,
  minify: true,
  format: "iife",
  target: ["chrome100", "firefox113", "safari16.4"],
  charset: "ascii",
  legalComments: "none",
  banner: {
    js: `/*! Made from src/planish/view/web by "make view"; sources ${digest.digest("hex")}.\n\nIt holds three.js:\n\n${licence}\n*/`,
  },
  logLevel: "warning",
});
