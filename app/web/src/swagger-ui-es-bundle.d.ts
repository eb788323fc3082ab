// The bundle as an ES module, for which @types/swagger-ui-dist has no types.
declare module "swagger-ui-dist/swagger-ui-es-bundle.js" {
  export { SwaggerUIBundle as default } from "swagger-ui-dist";
}
