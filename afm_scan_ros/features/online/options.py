"""What this feature does while a scan runs, where its options and parameters say so."""

from functools import partial

from afm_scan_ros.features.online.adaptation import TIME_CONSTANT, Adaptation
from afm_scan_ros.features.online.adapted_scan import adapted_scan
from afm_scan_ros.features.online.line_correction import refuse_unsuited
from afm_scan_ros.features.online.line_feedback import fed_back
from afm_scan_ros.nodes.parameters import NodeParameter, OnlineOption

LINE_FEEDBACK = OnlineOption(
    help="Correct offset, tilt and gain of each line from the lines before it.",
    parameters=(
        NodeParameter(
            "line_feedback",
            default=False,
            description="Whether offset, tilt and gain are corrected from the last lines",
        ),
    ),
    refuse_unsuited=partial(refuse_unsuited, "line feedback"),
    correction=lambda _: fed_back,
)
ADAPT = OnlineOption(
    help="Track changes of gain, resonance and slow creep, and scan accordingly.",
    parameters=(
        NodeParameter(
            "adapt",
            default=False,
            description="Whether changes of gain, resonance and slow creep are tracked",
        ),
        NodeParameter(
            "adapt_time_constant_s", TIME_CONSTANT, "With adapt: memory of the estimator", low=0.0
        ),
    ),
    refuse_unsuited=partial(refuse_unsuited, "adaptation"),
    correction=lambda given: partial(adapted_scan, given["adapt_time_constant_s"]),
    tracker=lambda model, spec, given: Adaptation(model, spec, given["adapt_time_constant_s"]).news,
)
