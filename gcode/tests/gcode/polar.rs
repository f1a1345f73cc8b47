//! Polar coordinates: `@` and `^`.

use super::listing::{listing, listing_with, xyz};

#[test]
fn by_distance_and_angle_about_the_programs_origin() {
    insta::assert_snapshot!(listing(
        "F600 G1 @10 ^30
X3 Y4
@10
^90
G91 @2 ^30
^30
G90 G20 @1 ^0 Z1
G21 G2 @10 ^90 R20
G0 @-5 ^0
M2"
    ));
}

#[test]
fn about_the_origin_of_a_work_offset_and_in_cycles() {
    let mut setup = xyz();
    setup.tables.work_offsets[0].0[0] = 100.0;
    setup.tables.g28.0[1] = 50.0;
    insta::assert_snapshot!(listing_with(
        setup,
        "G0 @20 ^0
F300 G91 G81 ^90 R0 Z-5 L3
G80 G90
G28 @30 ^180
M2"
    ));
}
