"""The errors that end a command: invalid input, and a scan that failed."""


class InputError(ValueError):
    """Something given to the package is wrong: file, argument or data.

    The message is one line that names the file or argument, the place in it and the fix; line ends
    that a library or a file put into it become blanks. A command that meets it exits with status 2.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(" ".join(str(message).splitlines()))


class ScanError(RuntimeError):
    """The work was done, but what was asked does not hold: a limit exceeded, a scan incomplete.

    The message is one line that names the sample, axis and value where there is one.
    A command that meets it exits with status 3.
    """


class SampleError(ScanError):
    """A sample of a block is beyond what an effect can do.

    ``sample`` is its index in the block, ``problem`` states what is wrong and how to fix it. A
    caller that knows the axis and the block's place in the scan names these instead.
    """

    def __init__(self, sample: int, problem: str) -> None:
        super().__init__(f"sample {sample} of the block: {problem}")
        self.sample = sample
        self.problem = problem
