# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Times in PyTorch what `semrover bench` times in Vulkan: one JSON line for each result. First it builds and compiles
the networks, then it waits until the file that --wait names exists, then it takes all timings. Modes: eager; graph, the
eager kernels in a CUDA graph, without the time that Python takes to launch them; compiled, torch.compile's."""
import argparse
import contextlib
import itertools
import json
import math
import os
from pathlib import Path
import statistics
import subprocess
import sys
import time

os.environ.setdefault("TORCHINDUCTOR_COMPILE_THREADS", "8")
os.environ.setdefault("TORCHINDUCTOR_CACHE_DIR", "/tmp/peers_inductor")
os.environ.setdefault("TRITON_CACHE_DIR", "/tmp/peers_triton")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "train"))

import torch
from torch import nn
from torch.nn import functional as F

from semtrain.nets import attention, image_blocks, transformer, unet, vae

START = time.monotonic()
COMPILE_AFTER_FILE = 20.0  # seconds after --wait's file appeared during which another network may begin to compile
MEASURE_MIN, MEASURE_MAX, SAMPLE_MS = 0.4, 3.0, 2.0  # seconds of a measurement; what one sample lasts at least
UNIT = {"tflops": 1e9, "gb_s": 1e6, "mpairs_s": 1e3}  # of a rate: operations, bytes or pairs in a millisecond
USERS = (unet, vae, transformer)  # of nets/attention.py
attention_mask = transformer.VoxfieldTransformer.attention_mask


def log(text):
    print(f"peers: {time.monotonic() - START:.1f} s: {text}", file=sys.stderr, flush=True)


def emit(what, mode, peer="torch", **fields):
    """one line; numbers to five digits, errors to 400 characters"""
    fields = {name: float(f"{x:.5g}") if isinstance(x, float) else x for name, x in fields.items()}
    if isinstance(fields.get("error"), Exception):
        fields["error"] = f"{type(fields['error']).__name__}: {fields['error']}"[:400]
    print(json.dumps({"peer": peer, "what": what, "mode": mode, **fields}), flush=True)


def attend(q, k, v, mask=None):
    """in place of nets/attention.py's: in the precision of its arguments, whatever the device"""
    return attention.attention_of(q, k, v, mask)


def patch_networks(dtype):
    """PyTorch's own functions in place of those that go through fp32 for the sake of CPUs; the mask is computed once"""
    for module in USERS:
        module.attend = attend
    image_blocks.GroupNorm.forward = nn.GroupNorm.forward
    image_blocks.LayerNorm.forward = nn.LayerNorm.forward
    transformer.layer_norm = lambda x: F.layer_norm(x, x.shape[-1:], eps=1e-6)
    transformer.gelu_tanh = lambda x: F.gelu(x, approximate="tanh")
    transformer.VoxfieldTransformer.attention_mask = lambda self, *_: self.peer_mask
    of_unet, of_transformer = unet.UNet2DConditionModel._sinusoids, transformer.sinusoids
    unet.UNet2DConditionModel._sinusoids = lambda self, timestep: of_unet(self, timestep).to(dtype)
    transformer.sinusoids = lambda x, width: of_transformer(x, width).to(dtype)


def flops_of(call):
    """operations of the convolutions, linear layers and attentions of a network's call; what it returns"""
    total = [0]

    def hook(module, _, out):
        if isinstance(module, (nn.Linear, nn.Conv2d)):
            total[0] += 2 * out.numel() * module.weight[0].numel()

    def counted(q, k, v, mask=None):
        total[0] += 4 * q.numel() * k.shape[-2]
        return attend(q, k, v, mask)
    handle = nn.modules.module.register_module_forward_hook(hook)
    try:
        for module in USERS:
            module.attend = counted
        out = call()
    finally:
        handle.remove()
        for module in USERS:
            module.attend = attend
    return total[0], out


class Network:
    """a network's function with its arguments, eager and, once compiled, compiled"""

    def __init__(self, function, *arguments):
        self.function, self.arguments, self.compiled, self.notes = function, arguments, None, {}
        self.flops, out = flops_of(self.eager)
        self.expected = (out[0] if isinstance(out, tuple) else out).float()
        self.finite = bool(torch.isfinite(self.expected).all())

    def eager(self):
        return self.function(*self.arguments)

    def compiled_call(self):
        torch.compiler.cudagraph_mark_step_begin()
        return self.compiled(*self.arguments)

    def compile(self):
        """and call it until its CUDA graph is there; notes: what went wrong silently, and how far it is from eager"""
        from torch._dynamo.utils import counters

        def unwanted():
            return sum(counters["graph_break"].values()), counters["inductor"]["cudagraph_skips"]
        before, begin = unwanted(), time.monotonic()
        self.compiled = torch.compile(self.function, mode="reduce-overhead", dynamic=False)
        try:
            for _ in range(3):
                out = self.compiled_call()
            off = ((out[0] if isinstance(out, tuple) else out).float() - self.expected).abs().max()
            self.notes = {"compile_s": time.monotonic() - begin, "off_eager": float(off / self.expected.abs().max())}
            self.notes.update(zip(("graph_breaks", "cudagraph_skips"), (b - a for a, b in zip(before, unwanted()))))
        except Exception:
            self.compiled = None
            raise


class Peers:
    def __init__(self, options):
        self.options, self.tiny = options, options.tiny
        self.device, self.dtype = ("cpu", torch.float32) if self.tiny else ("cuda", torch.float16)
        self.networks, self.shared, self.deadline = {}, {}, math.inf

    def random(self, *shape, scale=1.0):
        return torch.randn(shape, device=self.device).mul_(scale).to(self.dtype)

    def image(self, *shape, scale=1.0):
        return self.random(*shape, scale=scale).contiguous(memory_format=torch.channels_last)

    # networks

    def built(self, name, make):
        """one network for all shapes of that name"""
        if name not in self.shared:
            with contextlib.nullcontext() if self.tiny else torch.device(self.device):
                net = make()
            net = net.to(self.device, self.dtype).eval().requires_grad_(False)
            self.shared[name] = net.to(memory_format=torch.channels_last)
        return self.shared[name]

    def unet(self, batch, height, width):
        sizes = {"block_out_channels": [32, 32, 64, 64], "cross_attention_dim": 32} if self.tiny else {}
        net = self.built("unet", lambda: unet.UNet2DConditionModel({"in_channels": 13, **sizes}))
        return Network(net, self.image(batch, 13, height, width), torch.tensor(500.0, device=self.device),
                       self.random(batch, 77, net.config["cross_attention_dim"]))

    def vae(self, what, *shape):
        net = self.built("vae", lambda: vae.AutoencoderKL({"block_out_channels": [32] * 4} if self.tiny else {}))
        return Network(net.decode if what == "decode" else net.moments, self.image(*shape))

    def transformer(self, regions, cells):
        """a step of the denoiser for `regions` regions, each with its labels and, for guidance, without"""
        sizes = {"num_layers": 2, "num_attention_heads": 2, "attention_head_dim": 16} if self.tiny else {}
        net = self.built(f"transformer {regions}", lambda: transformer.VoxfieldTransformer(**sizes))
        side = math.ceil(math.sqrt(cells * 0.6))  # of the ground, a square; the other voxels are a wall
        places = [(i % side, min(i // side, side), max(i // side - side, 0)) for i in range(cells)]
        centers = (torch.tensor(places, device=self.device).float() * 0.6).repeat(2 * regions, 1, 1)
        valid = torch.ones(2 * regions, cells, dtype=torch.bool, device=self.device)
        labels = (torch.arange(cells, device=self.device) % 20).repeat(2 * regions, 1)
        labels[regions:] = 20
        mask = attention_mask(centers, valid, net.config["attention_radius"]).clamp_min(-6e4).to(self.dtype)
        net.register_buffer("peer_mask", mask, persistent=False)
        timestep = torch.full((2 * regions,), 500.0, device=self.device)
        return Network(net, self.random(2 * regions, cells, 120), labels, centers, valid, timestep)

    # measuring

    def sample(self, call, count):
        """milliseconds of a call, over `count` of them"""
        if self.tiny:
            begin = time.perf_counter()
            for _ in range(count):
                call()
            return (time.perf_counter() - begin) * 1e3 / count
        start, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
        start.record()
        for _ in range(count):
            call()
        end.record()
        end.synchronize()
        return start.elapsed_time(end) / count

    def times(self, call):
        for _ in range(3):
            call()
        count = max(1, min(64, math.ceil(SAMPLE_MS / max(self.sample(call, 1), 1e-3))))
        samples, begin, spent = [], time.monotonic(), 0.0
        while (len(samples) < 10 or spent < MEASURE_MIN) and spent < MEASURE_MAX:
            samples.append(self.sample(call, count))
            spent = time.monotonic() - begin
        return samples

    @staticmethod
    def captured(call, count):
        """a replay of `count` calls in one CUDA graph"""
        side = torch.cuda.Stream()
        side.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(side):
            for _ in range(3):
                call()
        torch.cuda.current_stream().wait_stream(side)
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph):
            for _ in range(count):
                call()
        return graph.replay

    def measure(self, what, mode, make, peer="torch", captured=1):
        """make() -> what to call, the unit of its rate, its amount, other fields; captured: calls in a graph"""
        if time.monotonic() > self.deadline:
            return emit(what, mode, peer, error="not begun: the time of --budget is over")
        call = run = None  # a graph needs the tensors of its call
        try:
            call, unit, amount, fields = (*make(), {})[:4]
            calls = captured if mode == "graph" else 1
            run = self.captured(call, calls) if mode == "graph" else call
            samples = [t / calls for t in self.times(run)]
            ms = statistics.median(samples)
            emit(what, mode, peer, ms_median=ms, ms_min=min(samples), runs=len(samples),
                 **{unit: amount / ms / UNIT[unit]}, **({"gflop": amount / 1e9} if unit == "tflops" else {}), **fields)
        except Exception as error:
            emit(what, mode, peer, error=error)
        del call, run
        if not self.tiny:
            with contextlib.suppress(Exception):
                torch.cuda.empty_cache()

    def kernel(self, what, make):
        for mode in ("eager",) if self.tiny else ("eager", "graph"):
            self.measure(what, mode, make, captured=20)

    def network(self, what):
        net = self.networks.get(what)
        for mode in ("eager",) if self.tiny else ("eager", "compiled", "graph"):
            if net is not None and (mode != "compiled" or net.compiled is not None):  # it has no truth value
                call, notes = (net.compiled_call, net.notes) if mode == "compiled" else (net.eager, {})
                self.measure(what, mode, lambda: (call, "tflops", net.flops, {"finite": net.finite, **notes}))

    # kernels: each returns what `measure` wants

    def gemm(self, m, n, k):
        sets = itertools.cycle([(self.random(m, k), self.random(n, k, scale=k ** -0.5).t()) for _ in range(4)])
        return lambda: torch.matmul(*next(sets)), "tflops", 2 * m * n * k

    def conv(self, batch, channels, size):
        x, w = self.image(batch, channels, size, size), self.image(channels, channels, 3, 3, scale=channels ** -0.5 / 3)
        return lambda: F.conv2d(x, w, padding=1), "tflops", 2 * x.numel() * w[0].numel()

    def sdpa(self, batch, heads, tokens, width, by_products=False):
        q, k, v = (self.random(batch, tokens, heads, width).transpose(1, 2) for _ in range(3))

        def call():
            if not by_products:
                return attend(q, k, v)
            return torch.softmax(q @ k.transpose(-1, -2) * width ** -0.5, -1) @ v
        return call, "tflops", 4 * q.numel() * tokens

    def sort(self, count, peer):
        keys, values = (torch.randint(-2 ** 31, 2 ** 31 - 1, (count,), dtype=torch.int32, device=self.device)
                        for _ in range(2))

        def by_torch():
            ordered, order = torch.sort(keys, stable=True)
            return ordered, values.gather(0, order)
        if peer == "torch":
            return by_torch, "mpairs_s", count
        import cupy
        own_keys, own_values = cupy.asarray(keys), cupy.asarray(values)

        def by_cupy():
            order = cupy.argsort(own_keys)
            return own_keys[order], own_values[order]
        return by_cupy, "mpairs_s", count

    def copy(self, count):
        return torch.randn(count // 4, device=self.device).clone, "gb_s", 2 * count

    # the two phases

    def late(self):
        """whether it is too late to compile another network"""
        o = self.options
        if not o.wait:
            return False
        since_file = time.time() - os.stat(o.wait).st_mtime if os.path.exists(o.wait) else 0
        return since_file > COMPILE_AFTER_FILE or time.monotonic() - START > o.wait_limit

    def prepare(self):
        """builds all networks and compiles the first four, the most important first"""
        side, odd, image, most, cells = (8, (7, 9), 64, 2, 16) if self.tiny else (64, (53, 77), 512, 16, 128)
        makes = {f"unet 2x13x{side}x{side}": lambda: self.unet(2, side, side),
                 f"transformer {most}x{cells} guided": lambda: self.transformer(most, cells),
                 f"vae decode {side}x{side}": lambda: self.vae("decode", 1, 4, side, side),
                 f"transformer 1x{cells} guided": lambda: self.transformer(1, cells),
                 f"unet 1x13x{odd[0]}x{odd[1]}": lambda: self.unet(1, *odd),
                 f"vae decode {odd[0]}x{odd[1]}": lambda: self.vae("decode", 1, 4, *odd),
                 f"vae encode {image}x{image}": lambda: self.vae("encode", 1, 3, image, image)}
        for what, make in makes.items():
            try:
                self.networks[what] = make()
            except Exception as error:
                emit(what, "eager", error=error)
        log("networks built")
        names = list(makes)
        self.first, self.rest = [names[i] for i in (0, 2, 1, 3)], names[4:]
        for what in [] if self.options.no_compile or self.tiny else names[:4]:
            try:
                if self.late():
                    raise TimeoutError("not compiled: too late")
                if what in self.networks:
                    self.networks[what].compile()
                    log(f"compiled {what}: {self.networks[what].notes}")
            except Exception as error:
                emit(what, "compiled", error=error)
        log("phase 1 done")

    def wait(self):
        o = self.options
        while o.wait and not os.path.exists(o.wait) and time.monotonic() - START < o.wait_limit:
            time.sleep(0.2)

    def time_all(self):
        log("phase 2 begins")
        self.deadline = time.monotonic() + self.options.budget
        small = 64 if self.tiny else 1
        for size in ((4096, 4096, 4096), (3200, 4096, 1024), (4096, 320, 2880), (384, 4096, 1024), (8192, 8192, 8192)):
            m, n, k = (max(x // small, 8) for x in size)
            self.kernel(f"gemm {m}x{n}x{k}", lambda: self.gemm(m, n, k))
        for what in self.first:
            self.network(what)
        for count in (33554432 // small, 1000000 // small):
            for peer in ("torch",) if self.tiny else ("torch", "cupy"):
                self.measure(f"sort {count} pairs", "eager", lambda: self.sort(count, peer), peer)
        for batch, channels, size in ((2, 320, 64), (2, 640, 32), (1, 512, 256), (1, 128, 512)):
            channels, size = (channels // 16, size // 4) if self.tiny else (channels, size)
            self.kernel(f"conv3x3 {batch}x{channels}x{size}x{size}", lambda: self.conv(batch, channels, size))
        for batch, heads, tokens, width in ((2, 8, 4096, 40), (2, 8, 1024, 80), (1, 1, 4096, 512)):
            shape = (batch, heads, tokens // small, width)
            what = "attention " + "x".join(map(str, shape))
            self.kernel(what, lambda: self.sdpa(*shape))
            if width > 256:  # wider than the fast kernels take
                self.kernel(what + " by products", lambda: self.sdpa(*shape, by_products=True))
        for what in self.rest:
            self.network(what)
        self.measure("copy", "eager", lambda: self.copy(2 ** 30 // small))
        log("done")


def machine(tiny):
    fields = {"torch": torch.__version__, "cuda": torch.version.cuda, "device": "cpu"}
    if not tiny:
        fields.update(device=torch.cuda.get_device_name(), cudnn=torch.backends.cudnn.version())
        with contextlib.suppress(Exception):
            fields["driver"] = subprocess.run(
                ["nvidia-smi", "--query-gpu=driver_version", "--format=csv,noheader"], capture_output=True, text=True,
                timeout=10, check=True).stdout.split()[0]
    return fields


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--wait", metavar="FILE", help="take the timings once this file exists")
    parser.add_argument("--wait-limit", type=float, default=240, metavar="S",
                        help="seconds since the start after which they are taken anyway (%(default)s)")
    parser.add_argument("--budget", type=float, default=60, metavar="S",
                        help="seconds of timing after which no measurement begins (%(default)s)")
    parser.add_argument("--no-compile", action="store_true", help="eager and graph only")
    parser.add_argument("--tiny", action="store_true", help="small sizes in fp32 on the CPU, eager only, as a test")
    options = parser.parse_args()
    torch.manual_seed(1)
    torch.backends.cudnn.benchmark = True
    emit("machine", "info", **machine(options.tiny))
    peers = Peers(options)
    patch_networks(peers.dtype)
    with torch.no_grad():
        peers.prepare()
        peers.wait()
        peers.time_all()


if __name__ == "__main__":
    main()
