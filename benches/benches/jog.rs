//! What a jog costs in the cycle: processor time of an order, and of every `advance`, nine axes on their
//! way to places that change in mid-motion: `cargo bench -p syncline-benches --bench jog`. Cycles that
//! plan are measured three times from the same state; the least is what the host did not disturb.

use std::hint::black_box;
use std::time::Duration;
use syncline_controller::realtime::thread_time;
use syncline_trajectory::limits::{Limits, PositionLimits};
use syncline_trajectory::path::{Executor, Jog, Travel};

const N: usize = 9;
const PERIOD: f64 = 0.002;
/// So many axes are planned in a cycle.
const PLANS: usize = 2;

fn advance(plan: &mut Executor<N>) -> Duration {
    let begin = thread_time();
    black_box(plan.advance());
    thread_time() - begin
}

fn main() {
    let travel = Travel {
        limits: Limits::symmetric(500.0, 5_000.0, 80_000.0),
        bounds: PositionLimits {
            min: -200.0,
            max: 200.0,
        },
    };
    let mut random = 1_u64;
    let mut next = move || {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (random >> 33) as f64 / (1_u64 << 31) as f64
    };
    println!(
        "{:14} {:>9} {:>9} {:>9} {:>9}",
        "µs", "calls", "p50", "p99.9", "max"
    );
    for (name, apart) in [("each axis", true), ("on a line", false)] {
        let mut plan = Executor::new([0.0; N], PERIOD);
        let [mut orders, mut planning, mut least, mut under_way]: [Vec<Duration>; 4] =
            Default::default();
        let plans = if apart { N.div_ceil(PLANS) } else { 1 };
        for _ in 0..5_000 {
            let to = std::array::from_fn(|_| Some(200.0 * (2.0 * next() - 1.0)));
            let jog = if apart {
                Jog::To(to)
            } else {
                Jog::Line {
                    to,
                    speed: f64::INFINITY,
                }
            };
            let begin = thread_time();
            plan.jog(jog, &[Some(travel); N])
                .expect("inside its travel");
            orders.push(thread_time() - begin);
            for cycle in 0..(200.0 * next()) as usize {
                if cycle < plans {
                    let again = [(); 2].map(|()| advance(&mut plan.clone()));
                    let took = advance(&mut plan);
                    planning.push(took);
                    least.push(again.into_iter().fold(took, Duration::min));
                } else {
                    under_way.push(advance(&mut plan));
                }
            }
        }
        for (what, mut took) in [
            ("order", orders),
            ("plan", planning),
            ("plan, least", least),
            ("under way", under_way),
        ] {
            took.sort_unstable();
            let at =
                |part: f64| took[((took.len() - 1) as f64 * part) as usize].as_secs_f64() * 1e6;
            println!(
                "{:24} {:>9} {:>9.2} {:>9.2} {:>9.2}",
                format!("{name}, {what}"),
                took.len(),
                at(0.5),
                at(0.999),
                at(1.0)
            );
        }
    }
}
