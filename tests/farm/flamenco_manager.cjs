// What Flamenco's Manager gives to a job type, for a test: node flamenco_manager.cjs SCRIPT VERSION < JOB.json
//
// Prints the job's settings and its tasks as JSON. With "chunks" in place of SCRIPT it prints frameChunker's chunks of
// the job's frames. Written after the Manager's source at 3.9-dev (job_compilers: author.go, js_globals.go).
"use strict";

const fs = require("node:fs");
const vm = require("node:vm");

function explodeFrames(range) {
    const frames = new Set();
    for (const part of range.replaceAll("..", "-").split(",")) {
        const ends = part.split("-").map((end) => end.trim());
        if (ends.length > 2 || !ends.every((end) => /^[+-]?\d+$/.test(end))) {
            throw new Error(`invalid range "${range}": ${part}`);
        }
        for (let frame = Number(ends[0]); frame <= Number(ends.at(-1)); frame++) {
            frames.add(frame);
        }
    }
    return [...frames].sort((a, b) => a - b);
}

function mergeFrames(frames) {
    const runs = [];
    for (const frame of frames) {
        const run = runs.at(-1);
        if (run && run[1] === frame - 1) {
            run[1] = frame;
        } else {
            runs.push([frame, frame]);
        }
    }
    return runs.map(([first, last]) => {
        if (first === last) {
            return `${first}`;
        }
        return last === first + 1 ? `${first},${last}` : `${first}-${last}`;
    }).join(",");
}

function frameChunker(range, size) {
    if (!String(range).trim()) {
        throw new Error(`invalid range "": empty range`);
    }
    if (size < 1) {
        throw new Error(`invalid chunk size, must be positive number: ${size}`);
    }
    const frames = explodeFrames(String(range).trim());
    if (!frames.length) {
        throw new Error(`invalid range "${range}": empty range`);
    }
    const chunks = [];
    for (let i = 0; i < frames.length; i += size) {
        chunks.push(mergeFrames(frames.slice(i, i + size)));
    }
    return chunks;
}

class Task {
    constructor(name, type) {
        if (!name.trim() || !type.trim()) {
            throw new Error("author.Task(name, type): name and type are required");
        }
        Object.assign(this, { name: name.trim(), type: type.trim(), commands: [], dependencies: [] });
    }
    addCommand(command) { this.commands.push(command); }
    addDependency(task) { this.dependencies.push(task); }
}

function compile(script, version, job) {
    const tasks = [];
    const globals = {
        print() {},
        alert() {},
        formatTimestampLocal: (stamp) => stamp,
        frameChunker,
        author: {
            // Go takes what it has parameters for, and zero for what is missing.
            Task: (name, type) => new Task(name, type),
            Command: version < 3.8
                ? (name, parameters) => ({ name, parameters })
                : (name, parameters, steps = 0) => ({ name, parameters, steps }),
        },
    };
    if (version >= 3.8) {
        globals.frameCount = (range) => explodeFrames(range).length;
    }
    const source = `"use strict";\n${fs.readFileSync(script, "utf8")}\n;({ JOB_TYPE, compileJob });`;
    const { JOB_TYPE, compileJob } = vm.runInNewContext(source, globals, { filename: script });
    const settings = {};
    for (const setting of JOB_TYPE.settings) {
        if (setting.default !== undefined) {
            settings[setting.key] = setting.default;
        }
    }
    Object.assign(settings, job.settings);
    const added = [];
    const addTask = (task) => {
        tasks.push(task);
        // Go copies the task: what is added to it afterwards is lost.
        const { name, type } = task;
        added.push({ name, type, commands: [...task.commands], dependencies: [...task.dependencies] });
    };
    compileJob({ ...job, settings, addTask });
    for (const task of added) {
        task.dependencies = task.dependencies.map((other) => tasks.indexOf(other));
    }
    return { job_type: JOB_TYPE, settings, tasks: added };
}

const [script, version] = process.argv.slice(2);
const job = JSON.parse(fs.readFileSync(0, "utf8"));
try {
    const made = script === "chunks"
        ? frameChunker(job.frames, job.chunk_size)
        : compile(script, Number(version), job);
    process.stdout.write(JSON.stringify(made));
} catch (error) {
    process.stderr.write(`${error.message ?? error}\n`);
    process.exitCode = 1;
}
