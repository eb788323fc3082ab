// What a user has given, and what is wrong with it, in words.

/** An error that is no defect: the title says of what kind, the hint what to do. */
export class InputError extends Error {
  constructor(
    readonly title: string,
    message: string,
    readonly hint: string,
  ) {
    super(message);
  }
}
