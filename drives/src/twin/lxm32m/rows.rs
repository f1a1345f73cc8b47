//! The rows of the dictionary that the twin gives a meaning to, looked up once.

use syncline_canopen::dictionary::{Dictionary, Row};

macro_rules! rows {
    ($($name:ident = $index:literal : $sub:literal;)*) => {
        /// Handles of rows, named by what they hold.
        #[derive(Clone, Copy, Debug)]
        pub(super) struct Rows {
            $(pub(super) $name: Row,)*
        }

        impl Rows {
            /// # Panics
            /// If the table lacks one of them, which a unit test of the table excludes.
            pub(super) fn new(objects: &Dictionary) -> Self {
                Self {
                    $($name: objects.row($index, $sub).expect(stringify!($name)),)*
                }
            }
        }
    };
}

rows! {
    error_register = 0x1001:0;
    error_count = 0x1003:0;
    error_field = 0x1003:1;
    last_warning = 0x301C:0x09;
    warnings_active = 0x301C:0x0B;
    warnings_latched = 0x301C:0x0C;
    position_denominator = 0x3006:0x07;
    position_numerator = 0x3006:0x08;
    velocity_denominator = 0x3006:0x21;
    velocity_numerator = 0x3006:0x22;
    ramp_denominator = 0x3006:0x30;
    ramp_numerator = 0x3006:0x31;
    quick_stop_ramp = 0x3006:0x12;
    velocity_limit = 0x3011:0x10;
    feed_forward = 0x3012:0x06;
    ds402_compatible = 0x301B:0x13;
    sync_tolerance = 0x3022:0x04;
    sync_start = 0x3022:0x05;
    sync_status = 0x3022:0x06;
    last_error = 0x603F:0;
    controlword = 0x6040:0;
    statusword = 0x6041:0;
    mode = 0x6060:0;
    mode_active = 0x6061:0;
    position_internal = 0x6063:0;
    position = 0x6064:0;
    following_error_limit = 0x6065:0;
    standstill_window = 0x6067:0;
    velocity_reference = 0x606B:0;
    velocity = 0x606C:0;
    torque = 0x6077:0;
    profile_deceleration = 0x6084:0;
    setpoint = 0x60C1:1;
    period_value = 0x60C2:1;
    period_index = 0x60C2:2;
    position_deviation = 0x60F4:0;
    reference = 0x301E:0x0C;
    reference_internal = 0x301E:0x09;
    speed = 0x301E:0x08;
}
