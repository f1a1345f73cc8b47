//! A planner that is never late, and an executor: items in, setpoints out.

use syncline_trajectory::path::{Command, Curve, Executor, Limits, PathItem, Planner, Setpoint};
use syncline_trajectory::shaper::{Method, Spread};

/// What runs, and what it still has to.
#[derive(Clone)]
pub(crate) struct Machine<'a> {
    pub(crate) executor: Executor<3>,
    planner: Planner<3>,
    items: std::slice::Iter<'a, PathItem<3>>,
    finished: bool,
    /// The curves that were planned along, each with its tag.
    pub(crate) path: Vec<(u32, Curve<3>)>,
}

impl<'a> Machine<'a> {
    /// At rest where the items begin.
    pub(crate) fn new(
        limits: Limits<3>,
        items: &'a [PathItem<3>],
        start: [f64; 3],
        period: f64,
    ) -> Self {
        Machine {
            executor: Executor::new(start, period),
            planner: Planner::new(limits, start),
            items: items.iter(),
            finished: false,
            path: Vec::new(),
        }
    }

    /// What is behind it shapes setpoints by that method, or by each mode's, and may leave moves that end at rest by `exact` mm.
    pub(crate) fn shape_by(&mut self, spread: Spread, method: Option<Method>, exact: f64) {
        self.planner.shape_by(spread, method, exact);
        if method != Some(Method::Coordinates) {
            self.executor.settle(spread);
        }
    }

    /// Goes on by one cycle; none where nothing is left.
    pub(crate) fn advance(&mut self) -> Option<Setpoint<3>> {
        let Machine {
            executor, planner, ..
        } = self;
        if let Some(request) = executor.replan_request() {
            planner.replan(&request);
        }
        while executor.room() > 0 {
            if let Some(command) = planner.pop() {
                if let Command::PathSegment(it) = command {
                    self.path.push((it.tag, it.curve));
                }
                assert!(executor.accept(command));
            } else if executor.is_held() {
                break;
            } else if let Some(item) = self.items.next() {
                planner.push(*item).unwrap();
            } else if !self.finished {
                planner.finish();
                self.finished = true;
            } else {
                break;
            }
        }
        assert_eq!(executor.late_plans(), 0);
        assert!(executor.cycle() < 1_000_000, "never ends");
        (!executor.is_idle()).then(|| executor.advance())
    }
}
