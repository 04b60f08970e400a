# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The loop that all recipes share: Adam, warm-up and decay, EMA, checkpoints that a later run continues, loss curves."""
import json
import math
import signal
import time

import torch

from . import precision, processes, safetensors_file
from .__main__ import STOPPED
from .curve import draw_curve
from .nets.norms import batch_norms
from .nets.recompute import recompute_blocks
from .run_folder import CHECKPOINT, LOG, RunFolder

HELD_OUT_STEPS = 8  # of which the held-out loss is the mean: always the same samples and noise


def learning_rate(config, step):
    """constant after `warmup` steps, falling linearly to 0 over the last `decay` of `steps`"""
    left = (config["steps"] - step) / max(1.0, config["decay"] * config["steps"])
    return config["learning_rate"] * min(1.0, (step + 1) / max(1, config["warmup"]), max(left, 0.0))


def parts_of(config):
    """a batch, divided among processes and then into `accumulate` parts -> those of this process, ranges of samples"""
    batch, accumulate = config["batch"], config["accumulate"]
    count = processes.count() * accumulate
    if batch % count:
        raise SystemExit(f"batch {batch}: expected a multiple of {count}, {processes.count()} processes times "
                         f"{accumulate} (accumulate)")
    size, first = batch // count, processes.rank() * accumulate
    return [range(i * size, (i + 1) * size) for i in range(first, first + accumulate)]


def scalar_writer(folder):
    """TensorBoard's"""
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError as error:
        raise SystemExit(f"tensorboard=true: {error}; pip install tensorboard") from None
    return SummaryWriter(folder)


class Trainer:
    """A model and a folder. `config` has the settings of settings.COMMON, steps, batch and learning_rate;
    `export(state)` writes the engine's files from the averaged weights. Where several processes train (processes.py)
    each has one, and that of rank 0 writes."""

    def __init__(self, folder, model, config, export):
        self.folder, self.config, self.export = folder, config, export
        self.model = model.to(config["device"])
        self.parts = parts_of(config)
        if len(self.parts[0]) < config["batch"] and batch_norms(model):
            raise SystemExit("this network has batch norms, whose statistics are those of a whole batch: expected one "
                             "process and accumulate 1")
        if config["recompute"]:
            recompute_blocks(self.model)
        self.parameters = dict(self.model.named_parameters())
        processes.share([p.data for p in self.parameters.values()])  # CPUs of other kinds may draw others
        self.average = {name: p.detach().clone() for name, p in self.parameters.items()}
        self.adam = torch.optim.Adam(self.model.parameters(), lr=config["learning_rate"], betas=config["betas"])
        self.step = 0
        self.signalled = False
        with processes.rank_0_first():
            writes = processes.rank() == 0
            self.place = RunFolder(folder, alone=writes)
            self.place.keep_settings(config)
            self.board = scalar_writer(self.place.file("tensorboard")) if config["tensorboard"] and writes else None
        self._resume()

    def start_from(self, state):
        """weights to begin with; nothing when the run has begun before"""
        if self.step == 0:
            self.model.load_state_dict({name: t.float() for name, t in state.items()})
            self.average = {name: p.detach().clone() for name, p in self.parameters.items()}

    def run(self, loss_of_step, held_out=None):
        """loss_of_step(model, step, part) -> (loss, {name: number} for the log) of a part of the step's batch, a range
        of its samples; until `steps`, `minutes` or a signal, after which the recipe ends with exit code 130.
        held_out: the same, of data that is not trained on; its loss is logged with every checkpoint"""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._stop)
        instead = precision.why_not(self.config["precision"], self.config["device"])
        if instead:
            print(instead, flush=True)
        self._compare()
        begin = saved = reported = time.time()
        recent, stopped = [], False
        while self.step < self.config["steps"] and not stopped:
            recent.append(self._advance(loss_of_step))
            now = time.time()
            if now - reported > 20 or self.step == self.config["steps"]:
                self._report(recent, (now - reported) / len(recent))
                recent, reported = [], now
            if now - saved > 60 * self.config["save_minutes"]:
                self.save(held_out)
                saved = time.time()
            late = self.config["minutes"] and now - begin > 60 * self.config["minutes"]
            stopped, late = processes.gathered([self.signalled, bool(late)]).any(0).tolist()
            if late:
                break
        if recent:
            self._report(recent, (time.time() - reported) / len(recent))
        self.save(held_out)
        processes.leave()
        self.place.release()
        if stopped:
            print(f"stopped at step {self.step} of {self.config['steps']}; the same command goes on", flush=True)
            raise SystemExit(STOPPED)

    def save(self, held_out=None):
        if processes.rank() > 0:
            return
        tensors = {f"model.{name}": p for name, p in self.parameters.items()}
        tensors.update({f"average.{name}": p for name, p in self.average.items()})
        for name, p in self.parameters.items():
            state = self.adam.state.get(p, {})
            if state:
                tensors[f"adam.exp_avg.{name}"] = state["exp_avg"]
                tensors[f"adam.exp_avg_sq.{name}"] = state["exp_avg_sq"]
        self.place.write_checkpoint(tensors, self.step, self.config["keep"])
        self.export({name: p.detach().cpu() for name, p in self.average.items()})
        if held_out:
            self._log({"step": self.step, "held_out": self._held_out_loss(held_out)})
        draw_curve(self.place.file(LOG), self.place.file("curve.png"))

    def _advance(self, loss_of_step):
        """one step -> {name: number}, the means over its batch"""
        for group in self.adam.param_groups:
            group["lr"] = learning_rate(self.config, self.step)
        self.adam.zero_grad(set_to_none=True)
        rows = []
        for part in self.parts:
            with precision.autocast(self.config["precision"], self.config["device"]):
                loss, about = loss_of_step(self.model, self.step, part)
            (loss * (len(part) / self.config["batch"])).backward()
            rows.append({"loss": float(loss.detach()), **about})
        processes.add_gradients(self.parameters.values())
        own = [sum(row[name] for row in rows) / len(rows) for name in rows[0]]
        numbers = dict(zip(rows[0], processes.gathered(own).mean(0).tolist()))
        if not math.isfinite(numbers["loss"]):
            raise RuntimeError(f"the loss is {numbers['loss']} at step {self.step}; the last checkpoint is in "
                               f"{self.folder}")
        torch.nn.utils.clip_grad_norm_(self.model.parameters(), self.config["clip"])
        self.adam.step()
        self.step += 1
        keep = min(self.config["ema"], (self.step + 1) / (self.step + 10))
        names = list(self.parameters)
        with torch.no_grad():
            torch._foreach_mul_([self.average[n] for n in names], keep)
            torch._foreach_add_([self.average[n] for n in names], [self.parameters[n] for n in names], alpha=1 - keep)
        return numbers

    @torch.no_grad()
    def _held_out_loss(self, held_out):
        """of the averaged weights"""
        own = {name: p.data for name, p in self.parameters.items()}
        try:
            for name, p in self.parameters.items():
                p.data = self.average[name]
            with precision.autocast(self.config["precision"], self.config["device"]):
                losses = [float(held_out(self.model, step, None)[0]) for step in range(HELD_OUT_STEPS)]
        finally:
            for name, p in self.parameters.items():
                p.data = own[name]
        return sum(losses) / len(losses)

    def _report(self, recent, seconds):
        row = {"step": self.step, "lr": learning_rate(self.config, self.step - 1), "seconds_per_step": round(seconds, 3)}
        for name in recent[0]:
            row[name] = sum(r[name] for r in recent) / len(recent)
        self._log(row)

    def _log(self, row):
        if processes.rank() > 0:
            return
        with open(self.place.file(LOG), "a") as file:
            file.write(json.dumps(row) + "\n")
        if self.board:
            for name in row.keys() - {"step"}:
                self.board.add_scalar(name, row[name], row["step"])
            self.board.flush()
        print(" ".join(f"{k} {v:.5g}" for k, v in row.items()), flush=True)

    def _resume(self):
        if not self.place.has_begun():
            return
        path = self.place.file(CHECKPOINT)
        tensors = safetensors_file.read(path)
        self.step = int(safetensors_file.read_header(path)[1]["step"])
        with torch.no_grad():
            for name, p in self.parameters.items():
                p.copy_(tensors[f"model.{name}"])
                self.average[name].copy_(tensors[f"average.{name}"])
                if f"adam.exp_avg.{name}" in tensors:
                    self.adam.state[p] = {
                        "step": torch.tensor(float(self.step)),
                        "exp_avg": tensors[f"adam.exp_avg.{name}"].to(p.device),
                        "exp_avg_sq": tensors[f"adam.exp_avg_sq.{name}"].to(p.device)}
        print(f"continuing {self.folder} at step {self.step}", flush=True)

    def _compare(self):
        """all processes begin with the same weights, also where they read them"""
        begun = processes.gathered([self.step, sum(float(p.detach().double().sum()) for p in self.parameters.values())])
        if not (begun == begun[0]).all():
            raise SystemExit(f"processes begin with different steps or weights: {begun.tolist()}; {self.folder}, "
                             "--init and the data have to be on a file system that all nodes see")

    def _stop(self, *_):
        self.signalled = True
