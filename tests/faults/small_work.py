# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Every command that writes files, on inputs so small that it takes a second, and what it left behind."""
import hashlib
import json
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest

SEMROVER = os.environ["SEMROVER"]
SOURCES = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(SOURCES / "tests/slurm"))
from small_job import write_labels  # noqa: E402

GOLDEN = SOURCES / "tests/golden"
POINTS = "--steps 1 --region-size 24 --coverage-threshold 6"
SIZE = "--path in/ahead.tum -W 24 -H 16 --threads 1"

JOB = """\
out = "../out/job"
model = "model"
seed = 7
[[scene]]
labels = "labels.sgrid"
[[drive]]
path = "ahead.tum"
width = 24
height = 16
[generate]
steps = 1
region_size = 24
coverage_threshold = 6
[output]
layout = "{layout}"
{more}
"""

MESH = """\
usemtl road
v 0 0 0
v 4 0 0
v 4 4 0.5
v 0 4 0
f 1 2 3 4
"""

BOX = "Car 0.00 0 -1.58 587.01 173.33 614.12 200.12 1.65 1.67 3.64 -0.65 1.71 16.70 -1.59\n"  # a line of KITTI's

# what the others read, in the order in which it is made
INPUTS = (
    f"generate in/labels.sgrid -m in/model {POINTS} -o in/points.sgrid",
    f"generate in/labels.sgrid -m in/model {POINTS} --along in/ahead.tum --horizon 1 --tile-size 3 -o in/tiles",
    f"render in/points.sgrid {SIZE} --npy -o in/drawn",
    "edit in/points.sgrid --remove building -o in/edited.sgrid",
    "dataset pack in/drawn -o in/set",
)

# those that go on from what is there, and those that begin again, which want -y where a file of theirs had its name
GOES_ON = {
    "generate": f"generate in/labels.sgrid -m in/model {POINTS} --ply out/points.ply -o out/points.sgrid",
    "generate_cold": f"generate in/labels.sgrid -m in/model {POINTS} -o out/points.sgrid",
    "generate_tiles": f"generate in/labels.sgrid -m in/model {POINTS} --order tiles --tile-size 3 -o out/points.sgrid",
    "generate_along":
        f"generate in/labels.sgrid -m in/model {POINTS} --along in/ahead.tum --horizon 1 --tile-size 3 -o out/tiles",
    "render": f"render in/points.sgrid {SIZE} --npy --top -o out/drawn",
    "refine": f"refine in/points.sgrid {SIZE} -m in/model --steps 1 -o out/refined",
    "refine_buffers": "refine in/drawn -m in/model --steps 1 -o out/refined",
    "edit": f"edit in/points.sgrid -m in/model --remove building {POINTS} -o out/edited.sgrid",
    "inpaint": f"inpaint in/points.sgrid -m in/model --class building {POINTS} --seeds 1,2 -o out/inpainted.sgrid",
    "run": "run in/job.toml",
    "run_shards": "run in/shards.toml",
}
BEGINS_AGAIN = {
    "edit_labels": "edit in/points.sgrid --remove building -o out/edited.sgrid",
    "edit_undo": "edit --undo in/edited.sgrid.undo in/edited.sgrid -o out/again.sgrid",
    "edit_cut": "edit in/points.sgrid --cut --class building -o out/stamp.sgrid",
    "voxelize": "voxelize in/mesh.obj --voxel-size 1 --points 4 -o out/voxels.sgrid",
    "fuse": "fuse in/drawn -o out/fused --tsdf-voxel 0.3 --max-depth 20",
    "tile": "tile in/points.sgrid -o out/tiles --tile-size 3",
    "tile_join": "tile in/tiles --join -o out/joined.sgrid",
    "page": "page --grid in/points.sgrid --frames drawn=in/drawn/color -o out/index.html",
    "pack": "dataset pack in/drawn -o out/set",
    "unpack": "dataset unpack in/set -o out/folder",
    "export_transforms": "dataset export in/drawn --to transforms -o out/transforms",
    "export_kitti": "dataset export in/drawn --to kitti -o out/kitti",
    "export_nuscenes": "dataset export in/drawn --to nuscenes -o out/nuscenes",
    "export_colmap": "dataset export in/drawn --to colmap -o out/colmap",
    "export_infinicube": "dataset export in/drawn --to infinicube -o out/infinicube",
    "export_drivestudio": "dataset export in/drawn --to drivestudio -o out/drivestudio",
    "convert_model": "convert in/model out/model --dtype f16",
    "convert_scene": "convert in/points.sgrid out/points.ply",
    "convert_path": "convert in/ahead.tum out/ahead.json",
    "convert_colmap": "convert in/ahead.tum out/colmap --path-format colmap --points in/points.sgrid --images in/drawn",
    "convert_boxes": "convert in/000000.txt out/objects.json --from kitti-boxes",
    "streets": "streets -o out/street --length 30 --voxel-size 2 --points 1 --images --samples 1 --spacing 20 -W 16 -H 8",
    "labels": "labels --vox out/palette.vox",
    "profile": f"generate in/labels.sgrid -m in/model {POINTS} --profile out/profile.json -o out/points.sgrid",
    "video": f"render in/points.sgrid {SIZE} --video out/drive.mp4 -o out/drawn",
}
COMMANDS = {**GOES_ON, **BEGINS_AGAIN}
OF_SCENES = ("voxelize", "fuse", "streets")

STATE = ("lock", "journal.jsonl")
PIECES = (".run/regions/", ".run/tiles/", "/encoded/", "/.work/")  # what stays of them only costs space
PASSING = ("seconds", "bytes", "computed", "resumed", "adopted")  # of results: what depends on when and how often


def write_conditioning(folder):
    """the text that a golden case's renderer was given"""
    data = (GOLDEN / "asd_rollout_tiny/tensors.safetensors").read_bytes()
    begin = 8 + struct.unpack("<Q", data[:8])[0]
    tensor = json.loads(data[8:begin])["input.encoder_hidden_states"]
    first, last = tensor["data_offsets"]
    header = json.dumps({"encoder_hidden_states": {**tensor, "data_offsets": [0, last - first]}}).encode()
    header += b" " * (-len(header) % 8)
    folder.mkdir()
    (folder / "conditioning.safetensors").write_bytes(
        struct.pack("<Q", len(header)) + header + data[begin + first:begin + last])


class SmallWork:
    """FOLDER/in has what is read, FOLDER/cache pipelines, FOLDER/out is empty before each trial."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder).resolve()
        self.input, self.out = self.folder / "in", self.folder / "out"
        for path in (self.input, self.out, self.folder / "cache"):
            path.mkdir(parents=True)
        shutil.copytree(GOLDEN / "sampling_ddpm/model", self.input / "model")
        for part, name in (("unet", "renderer"), ("vae", "vae")):
            shutil.copytree(GOLDEN / "asd_rollout_tiny/model" / part, self.input / "model" / name)
        write_conditioning(self.input / "model/conditioning")
        write_labels(self.input / "labels.sgrid", 2, 6)
        (self.input / "mesh.obj").write_text(MESH)
        (self.input / "000000.txt").write_text(BOX)
        (self.input / "ahead.tum").write_text("".join(f"{x} {x} 1.8 1.6 -0.5 0.5 -0.5 0.5\n" for x in (0.2, 0.8)))
        (self.input / "job.toml").write_text(JOB.format(layout="folder", more=""))
        (self.input / "shards.toml").write_text(JOB.format(layout="shards", more='buffers = ["color", "depth"]'))
        for line in INPUTS:
            done = self.run(line)
            assert done.returncode == 0, f"{line}: {done.stderr}"

    def line(self, line, more=()):
        words = line.split()
        program = SEMROVER + ("-scenes" if words[0] in OF_SCENES else "")
        return [program, *words, "--device", "0", "--require", "any", "--quiet", *more]

    def environment(self, name="", **variables):
        caches = {"MESA_SHADER_CACHE_DIR": os.environ.get("MESA_SHADER_CACHE_DIR", os.path.expanduser("~/.cache")),
                  "XDG_CACHE_HOME": str(self.out / "cache" if name.endswith("_cold") else self.folder / "cache")}
        return {**os.environ, **caches, "FAULT_FOLDER": str(self.folder), **variables}

    def start(self, line, more=(), name="", **variables):
        return subprocess.Popen(self.line(line, more), cwd=self.folder, env=self.environment(name, **variables),
                                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    def run(self, line, more=(), name="", **variables):
        """-> the process, which has ended; 120 s are a hang"""
        process = self.start(line, more, name, **variables)
        try:
            text = process.communicate(timeout=120)[1]
        except subprocess.TimeoutExpired:
            process.kill()
            text = process.communicate()[1] + "\nHANGS"
        return subprocess.CompletedProcess(process.args, process.returncode, None, text)

    def clear(self):
        shutil.rmtree(self.out)
        self.out.mkdir()

    def files(self):
        return sorted(p for p in self.out.rglob("*") if not p.is_dir())

    def results(self):
        """{name: what has to be the same again} of all that a command made, without its state"""
        found = {}
        for path in self.files():
            name = str(path.relative_to(self.out))
            if path.name not in STATE and not name.startswith("cache/") and ".semrover-" not in name and \
                    not name.endswith((".passing", ".making")) and not any(piece in name for piece in PIECES):
                found[name] = essence(path)
        return found

    def snapshot(self):
        """equal for equal trees, but for process numbers in names"""
        whole = hashlib.sha256()
        for path in sorted(self.out.rglob("*")):
            name = str(path.relative_to(self.out))
            if "/.work/" in name or path.name.startswith(".semrover-"):
                name = str(path.relative_to(self.out).parent)
            whole.update(f"{name}\0{'' if path.is_dir() else digest(path)}\n".encode())
        return whole.hexdigest()

    def temporaries(self):
        return [str(p.relative_to(self.out)) for p in self.out.rglob("*")
                if p.name.startswith(".semrover-") or p.name.endswith((".passing", ".making"))]


class SmallWorkTest(unittest.TestCase):
    """has a SmallWork, `work`, and the path of a file beside its folder, `log`"""

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="semrover-faults-")
        cls.addClassCleanup(folder.cleanup)
        cls.work = SmallWork(folder.name)
        cls.log = pathlib.Path(folder.name + ".log")
        cls.addClassCleanup(lambda: cls.log.unlink(missing_ok=True))


def differences(whole, now):
    return {name: (whole.get(name), now.get(name)) for name in {**whole, **now} if whole.get(name) != now.get(name)}


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def lasting(value):
    if isinstance(value, dict):
        return {k: lasting(v) for k, v in value.items() if not any(word in k for word in PASSING)}
    return [lasting(v) for v in value] if isinstance(value, list) else value


def essence(path):
    try:
        if path.name == "run.json":
            return str(lasting(json.loads(path.read_text())))
        if path.name == "manifest.json":
            manifest = json.loads(path.read_text())
            return f"{manifest['key']} {manifest['files']}"
        if path.name == "profile.json":
            events = json.loads(path.read_text())["traceEvents"]  # of this process: of one that goes on, what was left
            return f"a trace {all('name' in e for e in events)}"
    except (ValueError, KeyError) as error:
        return f"damaged: {error}"
    return digest(path)
