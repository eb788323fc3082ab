// Meshes of the store: list, get, make samples, upload.
import { authorization, call, getJson } from "./http";
import { ProblemError, parseProblem } from "./problemError";
import type { MeshDocument, MeshList } from "./types";

/** List up to a hundred meshes, from the start or after a cursor. */
export function listMeshes(cursor: string | null): Promise<MeshList> {
  const after = cursor === null ? {} : { cursor };
  return getJson(`v1/meshes?${new URLSearchParams({ limit: "100", ...after })}`);
}

export function getMesh(id: string): Promise<MeshDocument> {
  return getJson(`v1/meshes/${encodeURIComponent(id)}`);
}

export async function makeSample(name: string, faces: number): Promise<MeshDocument> {
  const parameters = new URLSearchParams({ sample: name, faces: String(faces) });
  return (
    await call(`v1/meshes?${parameters}`, { method: "POST" })
  ).json() as Promise<MeshDocument>;
}

/**
 * Upload a file with its name: the service tells its format by both.
 *
 * By XMLHttpRequest, because fetch does not report upload progress.
 */
export function uploadMesh(
  file: File,
  merge: "none" | "exact",
  onProgress: (share: number | null) => void,
  signal: AbortSignal,
): Promise<MeshDocument> {
  const form = new FormData();
  form.set("file", file);
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("POST", `v1/meshes?merge=${merge}`);
    for (const [name, value] of Object.entries(authorization())) {
      request.setRequestHeader(name, value);
    }
    request.upload.onprogress = ({ loaded, total }) =>
      onProgress(loaded < total ? loaded / total : null);
    request.onload = () => {
      if (request.status < 300) resolve(JSON.parse(request.responseText) as MeshDocument);
      else
        reject(
          parseProblem(
            request.status,
            request.responseText,
            request.getResponseHeader("X-Request-ID") ?? "",
          ),
        );
    };
    request.onerror = () =>
      reject(
        new ProblemError({
          title: "Upload interrupted",
          detail: "The service may have stopped, or the network or the file is no longer there.",
          code: "unknown",
          status: 0,
          request_id: "",
        }),
      );
    request.onabort = () => reject(new DOMException("The upload was cancelled.", "AbortError"));
    signal.addEventListener("abort", () => request.abort());
    request.send(form);
  });
}
