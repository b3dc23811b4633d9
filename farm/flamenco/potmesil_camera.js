// SPDX-License-Identifier: GPL-3.0-or-later
//
// Potmesil Camera's job type for Flamenco 3.7 and later: copy it into the folder `scripts` beside the Manager, and press
// "Refresh from Manager" in Blender. Workers need Blender with the extension. docs/farm.md says more.

const JOB_TYPE = {
    label: "Potmesil Camera",
    description: "Depth of field and motion blur after the render",
    settings: [
        { key: "frames", type: "string", required: true,
          eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
          evalInfo: { showLinkButton: true, description: "Scene frame range" },
          description: "Frames to make. Examples: '47', '1-30', '3, 5-10, 47-327'" },
        { key: "stage", type: "string", required: true, default: "both",
          choices: ["both", "all", "passes", "process"],
          description: "passes renders the samples files, process makes the pictures. both: as tasks of their own; all: in one task, frame by frame" },
        { key: "chunk_size", type: "int32", default: 5, propargs: { min: 1 }, visible: "submission",
          description: "Frames of a task" },
        { key: "samples", type: "string", subtype: "file_path", required: true,
          eval: "abspath(C.scene.potmesil_camera.samples_path)",
          evalInfo: { showLinkButton: true, description: "The scene's own" },
          description: "Samples files; #### is the frame" },
        { key: "output", type: "string", subtype: "file_path", required: true,
          eval: "abspath('//pictures/####.exr')",
          description: "Pictures, .exr or .png; #### is the frame" },
        { key: "existing", type: "string", default: "skip", choices: ["skip", "keep", "overwrite"],
          description: "What to do with frames that are there: skip them unless they are stale, keep all that are whole, or overwrite" },
        { key: "threads", type: "int32", default: 0, propargs: { min: 0 }, visible: "submission",
          description: "Cores of a task; 0 is all" },
        { key: "max_memory", type: "float", default: 0, propargs: { min: 0 }, visible: "submission",
          description: "GiB that processing keeps under; 0 is no limit" },
        // A worker never tries again a task that it failed, and a farm of one gives the job up.
        { key: "frame_retries", type: "int32", default: 2, propargs: { min: 0 }, visible: "submission",
          description: "Times that a failed frame is tried again within its task" },
        { key: "movie", type: "string", subtype: "file_path", default: "",
          description: "Video of all pictures at the end, such as film.mp4; empty is none" },

        { key: "blendfile", type: "string", required: true, visible: "web",
          description: "Path of the Blend file" },
        { key: "scene", type: "string", required: true, eval: "C.scene.name", visible: "web",
          description: "Name of the scene" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    const commands = {
        "both": ["passes", "process"],
        "all": ["render"],
        "passes": ["passes"],
        "process": ["process"],
    }[settings.stage];
    if (!commands) {
        throw `"${settings.stage}" is no stage`;
    }
    if (settings.movie && settings.stage === "passes") {
        throw "a movie needs pictures, which the stage passes does not make";
    }

    const last = [];
    for (const chunk of frameChunker(settings.frames, settings.chunk_size)) {
        let before = null;
        for (const command of commands) {
            const task = authorTask(settings, command, chunk);
            if (before) {
                task.addDependency(before);
            }
            job.addTask(task);
            before = task;
        }
        last.push(before);
    }
    if (settings.movie) {
        const movie = author.Task("movie", "blender");
        movie.addCommand(authorCommand(settings, [
            "movie", `--frames=${settings.frames}`, `--input=${settings.output}`, `--output=${settings.movie}`]));
        for (const task of last) {
            movie.addDependency(task);
        }
        job.addTask(movie);
    }
}

function authorTask(settings, command, chunk) {
    const words = [command, `--frames=${chunk}`, `--scene=${settings.scene}`, `--samples=${settings.samples}`];
    if (command !== "passes") {
        words.push(`--output=${settings.output}`);
    }
    words.push(`--existing=${settings.existing}`, `--frame-retries=${settings.frame_retries}`);
    if (settings.threads > 0) {
        words.push(`--threads=${settings.threads}`);
    }
    if (settings.max_memory > 0) {
        words.push(`--max-memory=${settings.max_memory}`);
    }
    // What a worker reads are the lines Saved, Time and Skipping.
    words.push("--progress=none");
    const task = author.Task(`${command}-${chunk}`, "blender");
    task.addCommand(authorCommand(settings, words, chunk));
    return task;
}

function authorCommand(settings, words, chunk) {
    // Steps came with 3.8: before it there is no frameCount, and Command takes two arguments.
    const steps = chunk && typeof frameCount === "function" ? [frameCount(chunk)] : [];
    // Of all commands only this one counts steps. Blender leaves what follows --command to the extension.
    return author.Command("blender-render", {
        exe: "{blender}",
        exeArgs: "{blenderArgs}",
        argsBefore: ["-b"],
        blendfile: settings.blendfile,
        args: ["--command", "potmesil_camera"].concat(words),
    }, ...steps);
}
