// The reference of the interface: openapi.json as Swagger UI shows it. Requests can be sent from it.
import SwaggerUIBundle from "swagger-ui-dist/swagger-ui-es-bundle.js";
import "swagger-ui-dist/swagger-ui.css";

SwaggerUIBundle({
  url: "openapi.json",
  dom_id: "#reference",
  deepLinking: true, // each operation has an address
  tryItOutEnabled: true,
  validatorUrl: null, // it would ask a service elsewhere
});
