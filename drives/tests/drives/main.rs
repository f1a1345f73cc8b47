//! Device models and twins from outside: a small master on a simulated bus, and the manuals' tables.

mod bus;
mod bus_budget;
mod cia401;
mod cia402_csp;
mod common;
mod lxm32m_dictionary;
mod lxm32m_golden_vectors;
mod lxm32m_interpolation;
mod lxm32m_loops;
mod lxm32m_modes;
mod lxm32m_node;
mod lxm32m_random_frames;
mod lxm32m_signals;
mod registry;
mod tlc5xx_dictionary;
mod tlc5xx_golden_vectors;
mod tlc5xx_modes;
mod tlc5xx_node;
mod tlc5xx_random_frames;
mod tsp10_dictionary;
mod tsp10_node;
mod twk_crn_dictionary;
mod twk_crn_golden_vectors;
mod twk_crn_node;
mod twk_crn_random_frames;
mod world;
