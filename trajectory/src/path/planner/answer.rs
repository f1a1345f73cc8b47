//! Plans the path anew from a state on it: after an override, a hold, for a single block, back along
//! it, and to rest.
//!
//! The executor says from which state on, in a [`ReplanRequest`]; what comes next replaces its plan
//! from there. Where nothing is found from that state the answer is a plan that is too late: the
//! executor follows its old one, which ends at rest, and asks again from another state.

use std::collections::VecDeque;

use super::{
    ANSWER_HALVINGS, Account, Cursor, MOST_FOLLOWED, NOTHING, PlanItem, Planner, RETRACE, Retrace,
    Section,
};
use crate::path::brake::brake;
use crate::path::override_transition::{attempts, minima};
use crate::path::plan::follow;
use crate::path::{Command, PathSegment, PathState, ReplanGoal, ReplanRequest};

/// States of the last plan from which a stop is tried, and the time between them, s.
const RESTS: usize = 4;
const FOLLOWED: f64 = 0.002;

impl<const N: usize> Planner<N> {
    /// Plans the rest of the path anew from the state that the executor asks for; the commands
    /// come next. Where nothing is found from there, the answer is a plan that is too late, and the
    /// executor, which follows its old plan meanwhile, will ask for one from another state. A request
    /// that was answered is passed over; false then.
    pub fn replan(&mut self, request: &ReplanRequest) -> bool {
        let news = request.revision > self.revision;
        if news {
            self.window.grant(self.most_work);
            self.answer(request);
        }
        news
    }

    fn answer(&mut self, request: &ReplanRequest) {
        self.revision = request.revision;
        self.override_speeds(request.overrides, request.turns);
        self.single_block = request.single_block;
        // The executor is on one of them, or on none.
        self.retraces
            .retain(|retrace| request.item == Some(retrace.number));
        if request.goal == ReplanGoal::Rest {
            self.come_to_rest(request);
            return;
        }
        // What is left of the section is less than lengths tell apart, but takes time.
        let from = request.departure;
        let under_way = request.item.and_then(|item| self.section(item));
        if from.speed > 0.0 && under_way.is_some_and(|section| section.ends_at(from.distance)) {
            self.find_nothing();
            return;
        }
        let (item, departure) = match request.goal {
            ReplanGoal::Retrace { asked } => self.retrace_from(request, asked),
            ReplanGoal::Ahead | ReplanGoal::Rest => self.ahead_from(request),
        };
        if departure.speed > 0.0 && self.section(item).is_some() {
            self.go_on(request.cycle, item, departure);
            return;
        }
        self.begin_answer(request.cycle, item, departure);
        self.plans[1].clear();
        match self.section(item) {
            Some(_) => {
                let ended = self.plan_window(None);
                if self.out.len() == 1 {
                    self.out.push_back(Command::Commit);
                }
                if ended {
                    self.begin_item(item + 1);
                }
            }
            None if matches!(request.goal, ReplanGoal::Retrace { .. }) => {
                // It cannot go back any further.
                self.out.extend([Command::Hold, Command::Commit]);
                self.cursor.step += 1;
                self.cursor.holds = true;
            }
            None => self.out.push_back(Command::Commit),
        }
    }

    /// What comes next replaces the old plan in that cycle, and begins from that state.
    fn begin_answer(&mut self, cycle: u64, item: u64, departure: PathState) {
        self.cursor = Cursor {
            item,
            departure,
            rest: departure.distance,
            halvings: ANSWER_HALVINGS,
            ..Cursor::default()
        };
        self.account = Account::open(departure.distance, &self.window);
        self.followed.clear();
        self.window.faster.clear();
        self.replace_from(cycle);
    }

    /// Plans on from a state in motion, or from where the old plan leads to from there.
    fn go_on(&mut self, cycle: u64, item: u64, departure: PathState) {
        if self.plans[1].from(item, departure).next().is_some() {
            self.plans.swap(0, 1);
        }
        self.plans[1].clear();
        let old: Vec<_> = self.plans[0].from(item, departure).collect();
        let before = self.cursor;
        for attempt in attempts(&old).filter(|attempt| attempt.followed <= MOST_FOLLOWED) {
            let (followed, ahead) = old.split_at(attempt.followed);
            let from = match ahead.first() {
                Some(next) => next.segment.into(),
                None => departure,
            };
            self.begin_answer(cycle, item, from);
            self.followed
                .extend(followed.iter().map(|planned| planned.segment));
            let kept = minima(ahead).next().unwrap_or(ahead.len());
            self.window
                .recall(if attempt.keeps { &ahead[..kept] } else { &[] });
            let ended = self.plan_window(Some((attempt, ahead)));
            if self.out.len() > 1 {
                if ended {
                    self.begin_item(item + 1);
                }
                return;
            }
        }
        self.find_nothing();
        self.cursor = before;
    }

    /// What comes next replaces the old plan in that cycle.
    fn replace_from(&mut self, cycle: u64) {
        self.out.clear();
        self.out.push_back(Command::ReplacePlan {
            revision: self.revision,
            cycle,
        });
    }

    /// Nothing was found: what comes too late is asked for again.
    fn find_nothing(&mut self) {
        self.replace_from(0);
        self.out.push_back(Command::Commit);
    }

    /// Plans the shortest stop, and nothing beyond until the next request.
    fn come_to_rest(&mut self, request: &ReplanRequest) {
        self.cursor.holds = true;
        let under_way = (request.item).and_then(|item| Some((item, self.section(item)?)));
        let found = under_way.and_then(|(item, section)| {
            let plans = self.plans.iter().rev();
            let old = plans.map(|plan| plan.from(item, request.departure).collect::<Vec<_>>());
            let old = old
                .into_iter()
                .find(|old| !old.is_empty())
                .unwrap_or_default();
            let path_segments = section.from(request.departure.distance);
            let (followed, braking) = (0..RESTS).find_map(|k| {
                let (followed, from) = follow(&old, request.departure, FOLLOWED * k as f64)?;
                let ahead = section.from(from.distance);
                let braking = brake(|k| ahead.get(k), &self.limits, from, 0.0)?;
                Some((followed, braking))
            })?;
            let begin = Command::Section {
                item,
                origin: section.origin,
                backward: item >= RETRACE,
                limits: self.limits,
            };
            let under_way = path_segments
                .iter()
                .take_while(|s| s.start < braking.end.distance);
            let mut plan = vec![begin];
            plan.extend(under_way.copied().map(Command::PathSegment));
            plan.extend(followed.into_iter().map(Command::JerkSegment));
            plan.extend(braking.segments().iter().copied().map(Command::JerkSegment));
            Some(plan)
        });
        let Some(plan) = found else {
            self.find_nothing();
            return;
        };
        self.replace_from(request.cycle);
        self.out.extend(plan);
        self.out.push_back(Command::Commit);
    }

    /// From where the path goes on.
    fn ahead_from(&self, request: &ReplanRequest) -> (u64, PathState) {
        let (item, departure) = match (request.item, self.retraces.first()) {
            (None, _) => return (self.first, PathState::default()),
            (Some(_), Some(back)) => {
                let distance = back.from - request.departure.distance;
                (
                    back.item,
                    PathState {
                        distance: distance.max(0.0),
                        ..PathState::default()
                    },
                )
            }
            (Some(item), None) => (item, request.departure),
        };
        match self.section(item) {
            Some(section) if !section.ends_at(departure.distance) => (item, departure),
            _ => (item + 1, PathState::default()),
        }
    }

    /// From where the path goes back: on a retrace that is under way, or on a new one to the
    /// beginning of a block.
    fn retrace_from(&mut self, request: &ReplanRequest, asked: u64) -> (u64, PathState) {
        let nowhere = (RETRACE, PathState::default());
        let mut number = RETRACE;
        let (mut item, mut from) = match (request.item, self.retraces.first()) {
            (None, _) => return nowhere,
            (Some(at), Some(back)) => {
                if !back.section.reaches_end(request.departure.distance) {
                    return (at, request.departure);
                }
                if back.asked == asked {
                    return nowhere;
                }
                number = at;
                (back.item, back.from - back.section.length)
            }
            (Some(item), None) => (item, request.departure.distance),
        };
        // From the beginning of a section, or a rest between two, into the one before.
        while self.section(item).is_none() || from <= NOTHING {
            if matches!(self.item(item), Some(PlanItem::Mark { one_way: true, .. })) {
                return nowhere;
            }
            let items = self.first..self.first + self.items.len() as u64;
            let Some(before) = item.checked_sub(1).filter(|before| items.contains(before)) else {
                return nowhere;
            };
            item = before;
            from = self.section(item).map_or(0.0, |section| section.length);
        }
        let Some(section) = self.section(item) else {
            return nowhere;
        };
        let last = (section.path_segments)
            .partition_point(|s| s.start < from - NOTHING)
            .saturating_sub(1);
        let end = section.path_segments[last].start + section.path_segments[last].curve.length();
        let mut section_back = Section {
            path_segments: Vec::new(),
            ends: VecDeque::new(),
            origin: section.origin + end,
            length: 0.0,
            closed: true,
        };
        let begin = section.move_start(from);
        let path_segments = section.path_segments[..=last].iter().rev();
        for path_segment in
            path_segments.take_while(|s| s.start + s.curve.length() > begin + NOTHING)
        {
            let passed = begin - path_segment.start;
            let curve = match path_segment.curve.length() {
                // The move begins in the midst of a curve that stands for several.
                length if passed > NOTHING => path_segment.curve.part(passed, length),
                _ => path_segment.curve,
            };
            section_back.push(
                PathSegment {
                    curve: curve.reversed(),
                    ..*path_segment
                },
                &[],
            );
        }
        number += 1;
        self.retraces.push(Retrace {
            number,
            asked,
            item,
            from: end,
            section: section_back,
        });
        let departure = PathState {
            distance: (end - from).max(0.0),
            ..PathState::default()
        };
        (number, departure)
    }
}
