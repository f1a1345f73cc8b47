//! Problems and peers for the benches in `benches/benches`, and campaigns against them.
//!
//! How plans of one axis compare with those of the reference, on a hundred random problems:
//!
//! ```
//! use syncline_benches::{campaign, cases::Class};
//!
//! let tally = campaign::run(Class::Generic, 100, 0, |what, case, by| {
//!     println!("{what} by {by}: {case:?}");
//! });
//! println!("{} shorter, {} longer of {}", tally.shorter, tally.longer, tally.compared);
//! assert_eq!((tally.failed, tally.unsound), (0, 0));
//! ```

pub mod campaign;
pub mod cases;
pub mod contours;
pub mod paths;
pub mod peer;
pub mod properties;
