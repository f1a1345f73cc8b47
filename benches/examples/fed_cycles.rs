//! The controller alone, fed with recorded input: no bus, no drives, no planner. For counting its
//! instructions:
//!
//! ```sh
//! cargo build --release -p syncline-benches --example fed_cycles
//! valgrind --tool=callgrind --callgrind-out-file=/dev/null --collect-atstart=no \
//!     --toggle-collect='*feed*' target/release/examples/fed_cycles 6 10000
//! ```
//!
//! The machine first runs with simulated drives, which is not counted: what each wake-up was handed
//! is kept. Then a controller in the same state is handed the same.

use std::time::Duration;
use syncline_canopen::Instant;
use syncline_controller::bench::rig::{Shape, Shuttle, ready_machine};
use syncline_controller::bus::{Burst, Outbox, Received};
use syncline_controller::control::{Controller, Instruction, Wake};
use syncline_controller::port::Port;

/// Coordinates of the plan, as `run` has them.
const N: usize = 9;

/// What one wake-up was handed.
struct Input {
    at: Instant,
    instructions: Vec<Instruction<N>>,
    received: Vec<(usize, Received)>,
}

/// Every wake-up's input, in order. Nothing here allocates.
#[inline(never)]
fn feed(controller: &mut Controller<N>, inputs: &[Input], outboxes: &mut [Outbox], echoes: bool) {
    for input in inputs {
        for &instruction in &input.instructions {
            controller.accept(instruction);
        }
        for (bus, received) in &input.received {
            controller.receive(*bus, received);
        }
        outboxes.iter_mut().for_each(Outbox::clear);
        controller.wake(input.at, outboxes);
        for (bus, outbox) in outboxes.iter().enumerate() {
            let frames = outbox.burst.as_slice().len();
            if frames > 0 {
                controller.burst_sent(bus, frames, Burst::Queued, echoes);
            }
        }
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1).map(|text| text.parse());
    let mut number = |default| arguments.next().map_or(default, |it| it.expect("a number"));
    let (axes, cycles): (usize, usize) = (number(6), number(10_000));
    let shape = Shape::on_fewest_buses(axes, Duration::from_millis(2)).expect("it fits");
    let mut machine = ready_machine::<N>(&shape);
    let mut plan = Shuttle::new(axes);
    let mut fed = machine.controller.clone();
    let echoes = machine.ports.iter().all(|port| port.echoes());

    let mut inputs = Vec::with_capacity(2 * cycles);
    for _ in 0..2 * cycles {
        let mut instructions = Vec::new();
        while machine.controller.room() > 0 {
            let instruction = plan.instruction();
            machine.controller.accept(instruction);
            instructions.push(instruction);
        }
        let at = machine
            .controller
            .next_wake()
            .map_or(Instant::ZERO, Wake::at);
        let received = machine.collect(at).expect("a simulated bus").to_vec();
        machine.compute(at);
        machine.send().expect("a simulated bus");
        inputs.push(Input {
            at,
            instructions,
            received,
        });
    }
    let mut outboxes = vec![Outbox::default(); shape.buses];
    feed(&mut fed, &inputs, &mut outboxes, echoes);

    let place = |controller: &Controller<N>| controller.row().map(|row| row.axes);
    assert_eq!(place(&fed), place(&machine.controller));
    assert_eq!((fed.end(), fed.late_setpoints()), (None, 0));
    println!("{cycles} cycles of {axes} axes on {} buses", shape.buses);
}
