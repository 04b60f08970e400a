# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The loop that all recipes share: Adam, warm-up and decay, EMA, checkpoints that a later run continues, loss curves."""
import json
import signal
import time

import torch

from . import precision, safetensors_file
from .__main__ import STOPPED
from .curve import draw_curve
from .run_folder import CHECKPOINT, LOG, RunFolder


def learning_rate(config, step):
    """constant after `warmup` steps, falling linearly to 0 over the last `decay` of `steps`"""
    left = (config["steps"] - step) / max(1.0, config["decay"] * config["steps"])
    return config["learning_rate"] * min(1.0, (step + 1) / max(1, config["warmup"]), max(left, 0.0))


def generator(config, step, stream=0):
    """random numbers of a step: a run that is continued draws what one that was not interrupted would"""
    return torch.Generator().manual_seed((config["seed"] * 1000003 + step) * 16 + stream)


def timesteps_at(shares, count, power):
    """shares of 0..1, raised to a power -> timesteps below count: with a power above 1 more are low, below 1 fewer"""
    return (shares ** power * count).long().clamp(max=count - 1)


def number_below(n, draw):
    """0..n - 1, from a generator"""
    return int(torch.randint(n, (1,), generator=draw))


class Trainer:
    """A model and a folder. `config` has steps, learning_rate, warmup, decay, ema, clip, seed, precision (bf16, fp32),
    device, minutes (0: no limit), save_minutes; `export(state)` writes the engine's files from the averaged weights."""

    def __init__(self, folder, model, config, export):
        self.folder, self.config, self.export = folder, config, export
        self.model = model.to(config["device"])
        self.parameters = dict(self.model.named_parameters())
        self.average = {name: p.detach().clone() for name, p in self.parameters.items()}
        self.adam = torch.optim.Adam(self.model.parameters(), lr=config["learning_rate"], betas=(0.9, 0.99))
        self.step = 0
        self.stopped = False
        self.place = RunFolder(folder)
        self.place.keep_settings(config)
        self._resume()

    def start_from(self, state):
        """weights to begin with; nothing when the run has begun before"""
        if self.step == 0:
            self.model.load_state_dict({name: t.float() for name, t in state.items()})
            self.average = {name: p.detach().clone() for name, p in self.parameters.items()}

    def run(self, loss_of_step):
        """loss_of_step(model, step) -> (loss, {name: number} for the log); until `steps`, `minutes` or a signal, after
        which the recipe ends with exit code 130"""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._stop)
        instead = precision.why_not(self.config["precision"], self.config["device"])
        if instead:
            print(instead, flush=True)
        begin = saved = reported = time.time()
        recent = []
        while self.step < self.config["steps"] and not self.stopped:
            recent.append(self._advance(loss_of_step))
            now = time.time()
            if now - reported > 20 or self.step == self.config["steps"]:
                self._report(recent, (now - reported) / len(recent))
                recent, reported = [], now
            if now - saved > 60 * self.config["save_minutes"]:
                self.save()
                saved = time.time()
            if self.config["minutes"] and now - begin > 60 * self.config["minutes"]:
                break
        if recent:
            self._report(recent, (time.time() - reported) / len(recent))
        self.save()
        self.place.release()
        if self.stopped:
            print(f"stopped at step {self.step} of {self.config['steps']}; the same command goes on", flush=True)
            raise SystemExit(STOPPED)

    def save(self):
        tensors = {f"model.{name}": p for name, p in self.parameters.items()}
        tensors.update({f"average.{name}": p for name, p in self.average.items()})
        for name, p in self.parameters.items():
            state = self.adam.state.get(p, {})
            if state:
                tensors[f"adam.exp_avg.{name}"] = state["exp_avg"]
                tensors[f"adam.exp_avg_sq.{name}"] = state["exp_avg_sq"]
        safetensors_file.write(self.place.file(CHECKPOINT), tensors, {"step": self.step})
        self.export({name: p.detach().cpu() for name, p in self.average.items()})
        draw_curve(self.place.file(LOG), self.place.file("curve.png"))

    def _advance(self, loss_of_step):
        for group in self.adam.param_groups:
            group["lr"] = learning_rate(self.config, self.step)
        with precision.autocast(self.config["precision"], self.config["device"]):
            loss, about = loss_of_step(self.model, self.step)
        if not torch.isfinite(loss):
            raise RuntimeError(f"the loss is {loss.item()} at step {self.step}; the last checkpoint is in {self.folder}")
        self.adam.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.model.parameters(), self.config["clip"])
        self.adam.step()
        self.step += 1
        keep = min(self.config["ema"], (self.step + 1) / (self.step + 10))
        names = list(self.parameters)
        with torch.no_grad():
            torch._foreach_mul_([self.average[n] for n in names], keep)
            torch._foreach_add_([self.average[n] for n in names], [self.parameters[n] for n in names], alpha=1 - keep)
        return {"loss": float(loss.detach()), **about}

    def _report(self, recent, seconds):
        row = {"step": self.step, "lr": learning_rate(self.config, self.step - 1), "seconds_per_step": round(seconds, 3)}
        for name in recent[0]:
            row[name] = sum(r[name] for r in recent) / len(recent)
        with open(self.place.file(LOG), "a") as file:
            file.write(json.dumps(row) + "\n")
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

    def _stop(self, *_):
        self.stopped = True
