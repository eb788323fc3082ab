// Uploads: files, or arrays, which become a PLY file.
import type { Connection } from "./connection.js";
import { parseProblem } from "./problemError.js";
import type { Call, MeshDocument } from "./types.js";

/** Vertices, and triangles of them: three numbers for each. */
export interface Triangles {
  vertices: ArrayLike<number>;
  faces: ArrayLike<number>;
}

/** Upload a form with a file, and report the share that has been sent, where the browser knows. */
export async function upload(
  connection: Connection,
  path: string,
  form: FormData,
  { signal, onProgress }: Call,
): Promise<MeshDocument> {
  if (onProgress && "XMLHttpRequest" in globalThis) {
    return uploadWithProgress(connection, path, form, onProgress, signal);
  }
  const init = { method: "POST", body: form, ...(signal && { signal }) };
  return (await connection.call(path, init)).json() as Promise<MeshDocument>;
}

/** The same by XMLHttpRequest, because fetch does not report it. */
function uploadWithProgress(
  connection: Connection,
  path: string,
  form: FormData,
  onProgress: (share: number) => void,
  signal?: AbortSignal,
): Promise<MeshDocument> {
  return new Promise((resolve, reject) => {
    signal?.throwIfAborted();
    const request = new XMLHttpRequest();
    request.open("POST", connection.to(path));
    for (const [name, value] of Object.entries(connection.authorization)) {
      request.setRequestHeader(name, value);
    }
    request.upload.onprogress = ({ loaded, total }) => onProgress(total > 0 ? loaded / total : 0);
    request.onload = () => {
      const { status, responseText } = request;
      if (status < 300) resolve(JSON.parse(responseText) as MeshDocument);
      else reject(parseProblem(status, responseText, (name) => request.getResponseHeader(name)));
    };
    request.onerror = () => reject(new TypeError("Failed to fetch: the upload was interrupted"));
    request.onabort = () => reject(signal?.reason);
    signal?.addEventListener("abort", () => request.abort());
    request.send(form);
  });
}

/** Return a binary PLY file, which holds every bit of the coordinates. */
export function plyOf({ vertices, faces }: Triangles): Blob {
  const head =
    "ply\nformat binary_little_endian 1.0\n" +
    `element vertex ${vertices.length / 3}\n` +
    "property double x\nproperty double y\nproperty double z\n" +
    `element face ${faces.length / 3}\nproperty list uchar int vertex_indices\nend_header\n`;
  const corners = new DataView(new ArrayBuffer((13 * faces.length) / 3));
  for (let i = 0; i < faces.length; i += 3) {
    const at = (13 * i) / 3;
    corners.setUint8(at, 3);
    for (let k = 0; k < 3; k++) corners.setInt32(at + 1 + 4 * k, faces[i + k] as number, true);
  }
  return new Blob([head, Float64Array.from(vertices), corners]);
}
