// What the chosen files are, and what is missing among them, so that it can be asked for before the upload.

const MESH = /\.(obj|ply|glb|gltf|stl|off|3mf|dae|x3d|wrl|usd[acz]?)$/i;
const IMAGE = /\.(jpe?g|png|tiff?|webp|bmp|jp2|j2k|p[gnp]m|hei[cf])$/i;
const HEAD = 1 << 16;
const WHOLE = 2e8; // larger files are not searched for texture coordinates

export const isImage = (file) => IMAGE.test(file.name);

/** Kind of the files ("none", "photo", "photos", "scan", "other"), a sentence on them, and what is missing, if anything. */
export async function recognize(files) {
  const images = files.filter(isImage);
  const mesh = files.find((file) => MESH.test(file.name));
  if (!files.length) return { kind: "none", sentence: "", missing: null, images };
  if (mesh) return { kind: "scan", ...(await scan(mesh, files, images)), images };
  if (images.length === files.length && images.length === 1) {
    return { kind: "photo", images, missing: null,
      sentence: "One photo: the page’s shape is estimated from its lines of text and its sides. For a folded or crumpled sheet add photos from other sides." };
  }
  if (images.length > 1) {
    return { kind: "photos", images, missing: null,
      sentence: `${images.length} photos of one sheet that lies still: its shape is measured. Best are eight to twelve from all around, each with the whole sheet on it.` };
  }
  return { kind: "other", images, sentence: "", missing: null };
}

async function scan(mesh, files, images) {
  const suffix = mesh.name.split(".").pop().toLowerCase();
  const has = (name) => files.some((file) => file.name.toLowerCase() === name.toLowerCase());
  const found = suffix === "obj" ? await inObj(mesh, files, has) : suffix === "ply" ? await inPly(mesh, has) : {};
  if (["stl", "off"].includes(suffix)) found.bare = true;
  let missing = found.missing ?? null;
  if (!missing && found.bare && !images.length) missing = `${mesh.name} has no photo. Add the photo that was taken with it.`;
  if (!missing && found.bare && found.placeless !== false && images.length && !files.some((file) => /\.json$/i.test(file.name))) {
    missing = `${mesh.name} does not say where its photo belongs. Add the camera of the photo (a JSON file).`;
  }
  return { missing, sentence: missing ? "" : images.length ? "A scan with its photo." : "A scan." };
}

async function inObj(mesh, files, has) {
  const head = await mesh.slice(0, HEAD).text();
  const library = /^\s*mtllib\s+(.+?)\s*$/im.exec(head)?.[1];
  if (/^v([ \t]+[^ \t\r\n]+){6}[ \t\r]*$/m.test(head)) return {}; // colours at its points
  if (!library) {
    const placed = mesh.size < WHOLE && /^vt\s/m.test(await mesh.text());
    return { bare: true, placeless: !placed };
  }
  if (!has(base(library))) return { missing: `${mesh.name} needs its material file ${base(library)}.` };
  const material = await files.find((file) => file.name.toLowerCase() === base(library).toLowerCase()).text();
  const maps = [...material.matchAll(/^\s*map_k[da]\s+(.+?)\s*$/gim)].map((line) => line[1]);
  if (!maps.length) return { bare: true, placeless: false };
  const named = (line) => files.some((file) => line.toLowerCase().endsWith(file.name.toLowerCase()));
  const lost = maps.find((line) => !named(line));
  return lost ? { missing: `${mesh.name} needs its photo ${base(lost)}.` } : {};
}

async function inPly(mesh, has) {
  const head = (await mesh.slice(0, HEAD).text()).split("end_header")[0];
  const image = /^comment\s+TextureFile\s+(.+?)\s*$/im.exec(head)?.[1];
  if (image) return has(base(image)) ? {} : { missing: `${mesh.name} needs its photo ${base(image)}.` };
  if (/^property\s+\w+\s+(red|r|diffuse_red)\s*$/im.test(head)) return {};
  return { bare: true, placeless: !/texcoord|texture_u|^property\s+\w+\s+[su]\s*$/im.test(head) };
}

const base = (path) => path.split(/[\\/]/).pop();
