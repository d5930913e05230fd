"""Stage `register`: a camera for each photo, photo by photo, and a verdict on each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from texproj.records import DOUBTED, CameraRecord, Fit
from texproj.stages import attempts
from texproj.stages.attending import PhotoFaultError, attended
from texproj.stages.bench import Workbench
from texproj.stages.beside import searched_beside
from texproj.stages.entries import camera_hash, own_registration, start_of
from texproj.stages.freshness import Freshness
from texproj.stages.keeping import Keeper
from texproj.stages.lineage import FAULT, Lineage, inputs, state
from texproj.stages.methods import (
    AUTO,
    MOST_COMPARED,
    NEAREST,
    Job,
    Search,
    is_slow,
    search_alone,
    search_by_others,
    search_by_own_means,
    shared_points,
)
from texproj.stages.outcomes import PhotoOutcome
from texproj.stages.partners import companions, compare_looks, load_graph
from texproj.stages.progress import Progress, silent
from texproj.stages.sites import Hands
from texproj.stages.surroundings import Surroundings
from texproj.stages.traces import STAGE, Trace
from texproj.stages.wave import Evidence, Wave

Names = tuple[str, ...]
STANDS_APART = (
    "shows nothing that the registered photos show; leave it out (`exclude`) or pick 8 points"
)
TOO_FEW = "a block needs three photos or more that overlap"
COMPARING = "comparing the photos on the surface"
LOOKS_PER_SEARCH = 4
"""Photos that are judged in the time in which one is searched."""


def register_photos(
    bench: Workbench, names: Sequence[str] | None = None, progress: Progress = silent
) -> list[PhotoOutcome]:
    """Register the photos `names` (all by default) whose result is stale; write cameras.json.

    What has means of its own comes first, then what other photos show, best evidence first, until
    nothing changes any more. A photo that fails stops no other. Results are written as they come,
    so that an interrupted run goes on where it stopped. Raises InputError for an unusable project,
    OutputError for one that cannot be written.
    """
    project = bench.project
    project.check_writable(project.work)
    chosen = list(names) if names is not None else project.photo_names
    with Keeper(project) as keeper:
        run = _Run(bench, chosen, keeper, progress)
        run.keep()
        with Hands(bench) as hands:
            run.attend_alone(hands)
            run.judge(hands)
        if run.asked == AUTO:
            run.keep_what_holds_again()
            if not run.registered:
                run.attend_by_agreement()
            loose, registered = run.without_means, run.registered
            if len(registered) < len(loose):  # few would vouch for many
                run.attend_together(loose, registered)
        if run.asked == "block":
            run.attend_as_block()
        if run.asked in (AUTO, "features"):
            run.attend_through_others()
        more = run.asked == AUTO and run.registered and run.attend_by_agreement()
        if more or (run.asked == AUTO and run.attend_together(run.newly_failed, run.registered)):
            run.attend_through_others()
        with Hands(bench) as hands:
            if run.judge(hands) and run.asked in (AUTO, "features"):
                run.attend_through_others()
                run.judge(hands)
        run.tell_what_it_rests_on()
    progress(STAGE, len(chosen), len(chosen), "")
    project.save_hashes()
    return [run.outcomes[name] for name in chosen]


class _Run:
    """The chosen photos on their way to their outcomes.

    waiting: those without an outcome; own: what came of what was tried before others were asked;
    places: the photos from whose place each was tried already; faulty: those that met a fault,
    alone or in a block; notes: what the others say of each; compared_looks: those of all are known;
    judged_by: the registered cameras by which the new ones were judged last.
    """

    def __init__(
        self, bench: Workbench, chosen: Sequence[str], keeper: Keeper, progress: Progress
    ) -> None:
        self.bench, self.project, self.chosen = bench, bench.project, chosen
        self.keeper, self.progress = keeper, progress
        self.asked: str = bench.project.settings.register.method
        self.outcomes: dict[str, PhotoOutcome] = {}
        self.entries = self.project.load_cameras()
        self.lineage = Lineage.of(self.project, self.entries)
        self.cameras, self.traces = dict(self.lineage.cameras), dict(self.lineage.traces)
        self.graph = load_graph(self.project)
        self.waiting = set(chosen)
        self.near = Surroundings.of(self.lineage, self.waiting, companions(self.project))
        self.own: dict[str, Search] = {}
        self.places: dict[str, set[str]] = {}
        self.blocks: dict[str, tuple[str, ...]] = {}
        self.failed_with: dict[str, Evidence] = {}
        self.faulty: set[str] = set()
        self.notes: dict[str, str] = {}
        self.compared_looks = False
        self.judged_by: Evidence = frozenset()

    # --- what is known

    @property
    def registered(self) -> dict[str, CameraRecord]:
        """The photos through which others could be found."""
        known = {n: self.entries[n] for n in self.project.photo_names if n in self.entries}
        return {n: entry for n, entry in known.items() if entry.vouches}

    @property
    def without_means(self) -> Names:
        """The photos without an outcome that have nothing of their own."""
        return tuple(n for n in self.chosen if n in self.waiting and not self.job(n).has_means)

    @property
    def newly_failed(self) -> Names:
        """The photos that failed in this run and were in no block."""
        failed = (o for o in self.outcomes.values() if o.may_be_helped and not o.kept)
        return tuple(outcome.name for outcome in failed if outcome.name not in self.blocks)

    def through(self, name: str) -> tuple[str, ...]:
        entry = self.entries.get(name)
        return entry.through if entry is not None else ()

    def waits(self, name: str) -> bool:
        """Whether a photo was found through one that has no outcome yet."""
        return any(other in self.waiting and other != name for other in self.through(name))

    def job(self, name: str) -> Job:
        neighbors = {other: self.entries[other] for other in self.near.around(name)}
        return Job(self.bench, name, start_of(self.entries.get(name)), neighbors)

    def evidence(self, name: str) -> Evidence:
        return frozenset((other, self.cameras[other]) for other in self.near.around(name))

    def strength(self, name: str) -> int:
        return shared_points(self.job(name))

    # --- the steps

    def keep(self) -> None:
        """Settle what holds, each photo after those through which it was found."""
        for name in self.lineage.order:
            if name in self.waiting:
                self.keep_if_it_holds(name, self.lineage.alone[name])

    def keep_what_holds_again(self) -> None:
        """Settle photos whose registered ones were sought anew and are where they were."""
        for name in self.lineage.order:
            if name in self.waiting and self.through(name):
                self.keep_if_it_holds(name, self.state(name))

    def attend_together(self, names: Names, anchors: Mapping[str, CameraRecord]) -> bool:
        """Place photos all at once; returns whether one was found."""
        searches = self.placed(names, anchors, attempts.as_block) if names else {}
        self.learn_companions()
        for name, found in searches.items():
            self.blocks[name] = names
            if name in anchors and found.fit is None:
                self.doubt(name, found.reason)
            elif found.fit is not None or name in self.outcomes or self.asked == "block":
                self.go_on(name, found)
            else:
                self.own[name] = found
        return any(found.fit is not None and found.fit.accepted for found in searches.values())

    def attend_as_block(self) -> None:
        """Place all photos without an outcome at once, since that was asked for."""
        names = tuple(name for name in self.chosen if name in self.waiting)
        anchors = {n: entry for n, entry in self.registered.items() if n not in self.waiting}
        self.attend_together(names, anchors)
        for name in names:
            if name in self.waiting:
                self.attend(name, partial(attempts.as_placed, Search(None, (TOO_FEW,), ("block",))))

    def doubt(self, name: str, reason: str) -> None:
        """The photo stays registered, but others do not bear it out: none is sought through it."""
        entry, trace = self.entries[name], self.traces[name]
        record = replace(entry, quality={**entry.quality, DOUBTED: True, "reason": reason})
        self.settle(PhotoOutcome(name, record, False, reason))
        self.keeper.add(record, trace or Trace(self.asked, (), (), {}))

    def go_on(self, name: str, found: Search) -> None:
        """What several photos together said of one, after what was tried of it before."""
        search = attempts.continued(found, self.outcomes.get(name), self.traces[name])
        self.attend(name, partial(attempts.as_placed, search))

    def placed(
        self, names: Names, anchors: Mapping[str, CameraRecord], how: attempts.Placing
    ) -> dict[str, Search]:
        """What is said of each of several photos that are placed together; what nobody foresaw in
        it is said of all of them.
        """
        told: Mapping[str, Fit | str]
        try:
            told = attended(
                ", ".join(names), lambda: how(self.bench, names, anchors, self.progress)
            )
        except PhotoFaultError as error:
            told = dict.fromkeys(names, str(error))
            self.faulty |= set(names)
        return attempts.as_searches(told)

    def attend_by_agreement(self) -> bool:
        """Bring failed photos from rough cameras to agree; returns whether one was found."""
        names = tuple(n for n in self.newly_failed if self.job(n).starts_somewhere)
        searches = self.placed(names, self.registered, attempts.by_agreement) if names else {}
        found = {n: s for n, s in searches.items() if s.fit is not None and s.fit.accepted}
        self.blocks |= dict.fromkeys(found, names)
        for name, search in found.items():
            self.go_on(name, search)
        return bool(found)

    @property
    def new(self) -> Names:
        """The photos that were registered in this run, or in one that was interrupted."""
        return tuple(n for n, o in self.outcomes.items() if attempts.is_new(o) and self.traces[n])

    def judge(self, hands: Hands) -> bool:
        """Refuse the new photos that others contradict; returns whether there was one."""
        shown = frozenset((name, self.cameras[name]) for name in self.registered)
        if not self.new or len(shown) < 2 or shown == self.judged_by:
            return False
        self.judged_by = shown
        crew = hands.crew_for(len(self.new) // LOOKS_PER_SEARCH)
        listen = partial(self.tell, COMPARING)
        found = attempts.judged(self.bench, self.registered, self.new, crew, listen)
        for name, told in found.items():
            if told.refusal:
                tried = trace.tried if (trace := self.traces[name]) else ()
                self.own[name] = Search(None, (told.refusal,), tried)
                self.attend(name, partial(attempts.as_placed, self.own[name]))
            else:
                self.note(name, told.proof, "")
                self.notes[name] = told.note
        return any(told.refusal for told in found.values())

    def tell_what_it_rests_on(self) -> None:
        """Note it with the photos of this run where the mesh does not tell their place."""
        if not self.new:
            return
        what = attempts.told_rests_on(self.bench, self.registered)
        for name in self.new:
            picked = self.entries[name].method == "points"
            told = filter(None, [self.notes.get(name), what if picked else ""])
            self.note(name, {"rests_on": what} if what else {}, "; ".join(told))

    def note(self, name: str, proof: dict[str, Any], note: str) -> None:
        """More to tell of a photo; its camera is the same."""
        record, trace = attempts.noted(self.entries[name], proof, note), self.traces[name]
        assert trace is not None
        self.entries[name], reason = record, record.quality["reason"]
        self.outcomes[name] = replace(self.outcomes[name], record=record, reason=reason)
        self.keeper.add(record, trace)

    def attend_alone(self, hands: Hands) -> None:
        """Photo by photo, by the method that was asked for or by the photo's own means."""
        if self.asked in ("features", "block"):
            return
        auto = self.asked == AUTO
        waiting = [n for n in (self.chosen if auto else self.lineage.order) if n in self.waiting]
        names = [n for n in waiting if not auto or (not self.through(n) and self.job(n).has_means)]
        jobs = [job for job in map(self.job, names) if is_slow(job, self.asked)]
        search = partial(search_alone, method=self.asked)
        found = searched_beside(self.bench, hands, jobs, search, self.tell)
        for name in names:
            self.own[name] = self.attend(name, found)

    def attend_through_others(self) -> None:
        """What the photos that are registered show of others, and those of others again."""
        search = self.by_others if self.asked == AUTO else attempts.by_features
        self.look_for_companions()
        wave = Wave(self.evidence, self.strength, self.waits)
        for name in self.chosen:
            if name in self.waiting or self.outcomes[name].may_be_helped:
                wave.add(name, self.failed_with.get(name))
        wave.look(self.chosen)
        self.near.take_stirred()
        while (following := wave.next()) is not None:
            name = following
            if name not in self.waiting or not self.keep_if_it_holds(name, self.state(name)):
                self.failed_with[name] = self.evidence(name)
                self.attend(name, search)
            if not self.outcomes[name].may_be_helped:
                wave.drop(name)
            if not self.outcomes[name].failed:
                stirred = self.near.take_stirred()
                wave.look(self.chosen if self.look_for_companions() else stirred)
        for name in wave.left:
            self.trace_again(name)

    def look_for_companions(self) -> bool:
        """Compare the looks of all photos, once, where there are too many registered ones to try
        each with a photo of which nothing is known; returns whether that was done.
        """
        if self.compared_looks or len(self.near.registered) <= MOST_COMPARED:
            return False
        self.compared_looks = True
        unknown = [n for n in self.chosen if n in self.waiting and not self.near.knows(n)]
        if unknown:
            compare_looks(self.bench, self.progress)
            self.learn_companions()
        return bool(unknown)

    def learn_companions(self) -> None:
        """Read again which photos show the same."""
        self.graph = load_graph(self.project)
        self.near.learn(companions(self.project))

    def by_others(self, job: Job) -> Search:
        """By the photo's own means where that was not tried yet, then by what others show."""
        own, before = self.own.get(job.name), self.places.get(job.name)
        if own is None:
            own = search_by_own_means(job) if job.has_means else Search()
            if own.fit is not None:
                return own
            self.own[job.name] = own
        if not job.has_means and self.graph.stands_apart(job.name, self.near.registered):
            return Search(None, (STANDS_APART,), ("features",))
        self.places[job.name] = {*(before or ()), *list(job.neighbors)[:NEAREST]}
        return search_by_others(job, own.reason if own.tried else "", before)

    # --- one photo

    def tell(self, name: str) -> None:
        """Tell that a photo is attended; whoever listens may stop the work."""
        done = min(len(self.outcomes), len(self.chosen) - 1)
        self.progress(STAGE, done, len(self.chosen), name)

    def state(self, name: str) -> Freshness:
        entry, trace = self.entries.get(name), self.traces[name]
        return state(self.lineage.sources, name, entry, trace, self.cameras, self.near.around)

    def keep_if_it_holds(self, name: str, now: Freshness) -> bool:
        if not now.settled or self.waits(name):
            return False
        entry = self.entries[name]
        trace = self.traces[name]
        if now.failed and trace is not None and "features" in trace.tried:
            around = self.near.around_before(name)
            self.failed_with[name] = frozenset((n, self.cameras[n]) for n in around)
        reason = entry.quality.get("reason", "") or now.reason
        self.settle(PhotoOutcome(name, entry, True, reason))
        return True

    def attend(self, name: str, search: Callable[[Job], Search]) -> Search:
        """Search the camera of a photo; whatever comes of it becomes its entry."""
        self.tell(name)
        job, before = self.job(name), self.entries.get(name)
        found, why = attempts.searched(job, search)
        self.faulty |= {name} if FAULT in why else set()
        if found.fit is None and name in self.faulty:
            why = {**why, FAULT: True}
        record = attempts.record_of(job, found, why)
        record = replace(record, extra=before.extra if before is not None else {})
        tried = tuple(dict.fromkeys([*self.own.get(name, Search()).tried, *found.tried]))
        self.settle(PhotoOutcome(name, record, False, record.quality.get("reason", "")))
        self.keep_trace(record, tried, tuple(job.neighbors))
        return found

    def settle(self, outcome: PhotoOutcome) -> None:
        """This is what became of a photo, as far as we know now."""
        name, record = outcome.name, outcome.record
        self.outcomes[name], self.entries[name] = outcome, record
        self.waiting.discard(name)
        self.cameras[name] = camera_hash(own_registration(record))
        self.near.settle(record)

    def keep_trace(self, record: CameraRecord, tried: tuple[str, ...], around: Names) -> None:
        """Write an entry and what it was made from."""
        placed = record.method == "block" or record.status == "failed"
        block = self.blocks.get(record.file, ()) if placed else ()
        read = inputs(self.lineage.sources, record, tried, block, self.cameras, lambda _: around)
        self.traces[record.file] = trace = Trace(self.asked, tried, block, read)
        self.keeper.add(record, trace)

    def trace_again(self, name: str) -> None:
        """Write what a photo was not found through, where some of that is gone since then: it
        would be found even less.
        """
        record, trace = self.entries[name], self.traces[name]
        assert trace is not None
        read = inputs(
            self.lineage.sources, record, trace.tried, trace.block, self.cameras, self.near.around
        )
        if read != trace.inputs:
            self.keeper.add(record, replace(trace, inputs=read))
