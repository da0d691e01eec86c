"""The errors that end a command: invalid input, and a scan that failed."""


class InputError(ValueError):
    """Something given to the package is wrong: file, argument or data; the exit status is 2.

    The message is one line that names the file or argument, the place in it and the fix.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(" ".join(str(message).splitlines()))


class ScanError(RuntimeError):
    """The work was done, but what was asked does not hold; the exit status is 3.

    The message is one line that names the sample, axis and value where there is one.
    """


class SampleError(ScanError):
    """A sample of a block is beyond what an effect can do: its index, and the ``problem``.

    A caller that knows the axis and the block's place in the scan names these instead.
    """

    def __init__(self, sample: int, problem: str) -> None:
        super().__init__(f"sample {sample} of the block: {problem}")
        self.sample = sample
        self.problem = problem
