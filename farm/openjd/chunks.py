"""Print the chunks of a template's step, one a line: what a scheduler with job arrays needs of the template.

python farm/openjd/chunks.py farm/openjd/template.yaml Process Frames=1-100 ChunkSize=10
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from openjd.model import (
    DecodeValidationError,
    DocumentType,
    StepParameterSpaceIterator,
    create_job,
    decode_job_template,
    document_string_to_object,
    preprocess_job_parameters,
)

EXTENSIONS = ["TASK_CHUNKING"]


def list_chunks(template: Path, step: str, parameters: dict[str, str]) -> list[str]:
    """Return the frames of each task of a step.

    Parameters
    ----------
    template : Path
        The job template, YAML or JSON.
    step : str
        Name of a step that has chunks.
    parameters : dict of str to str
        Values of the job's parameters. What is not there has its default; texts and paths without one may be
        left out too, as long as the frames do not come from them.

    Returns
    -------
    list of str
        What `--frames` takes: `1-4`, `5`, `10-16:3`, `3,50`.

    Raises
    ------
    ValueError
        The template or a parameter is wrong, or the step has no chunks.
    """
    kind = DocumentType.JSON if template.suffix == ".json" else DocumentType.YAML
    document = document_string_to_object(document=template.read_text(encoding="utf-8"), document_type=kind)
    job_template = decode_job_template(template=document, supported_extensions=EXTENSIONS)
    missing = {
        each.name: "-"
        for each in job_template.parameterDefinitions or []
        if each.default is None and each.type.value in ("STRING", "PATH")
    }
    values = preprocess_job_parameters(
        job_template=job_template,
        job_parameter_values={**missing, **parameters},  # type: ignore[arg-type]
        job_template_dir=template.resolve().parent,
        current_working_dir=Path.cwd(),
    )
    job = create_job(job_template=job_template, job_parameter_values=values)
    steps = {each.name: each for each in job.steps}
    if step not in steps:
        raise ValueError(f"There is no step {step}: the template has {', '.join(steps)}.")
    tasks = StepParameterSpaceIterator(space=steps[step].parameterSpace)
    name = tasks.chunks_parameter_name
    if name is None:
        raise ValueError(f"The step {step} has no chunks.")
    return [str(task[name].value) for task in tasks]


def main() -> int:
    """Print the chunks; 2 if the template or a parameter is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("template", type=Path)
    parser.add_argument("step")
    parser.add_argument("parameters", nargs="*", metavar="NAME=VALUE", help="the job's parameters")
    options = parser.parse_args()
    pairs = [each.partition("=") for each in options.parameters]
    for name, equals, _ in pairs:
        if not equals:
            parser.error(f"{name}: a parameter is written NAME=VALUE.")
    try:
        chunks = list_chunks(options.template, options.step, {name: value for name, _, value in pairs})
    except (OSError, ValueError, DecodeValidationError) as error:
        print(f"Error: {error}", file=sys.stderr)
        return 2
    print("\n".join(chunks))
    return 0


if __name__ == "__main__":
    sys.exit(main())
