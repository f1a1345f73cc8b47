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
    last_warning = 0x301C:0x09;
    warnings_active = 0x301C:0x0B;
    warnings_latched = 0x301C:0x0C;
    store_parameters = 0x3004:0x01;
    reset_parameters = 0x3004:0x08;
    position_denominator = 0x3006:0x07;
    position_numerator = 0x3006:0x08;
    velocity_denominator = 0x3006:0x21;
    velocity_numerator = 0x3006:0x22;
    ramp_denominator = 0x3006:0x30;
    ramp_numerator = 0x3006:0x31;
    quick_stop_ramp = 0x3006:0x12;
    torque_ramp_enabled = 0x3006:0x2C;
    torque_window = 0x3006:0x2D;
    pulse_position = 0x3008:0x05;
    pulse_velocity = 0x3008:0x06;
    velocity_limit = 0x3011:0x10;
    feed_forward = 0x3012:0x06;
    jog_activate = 0x301B:0x09;
    sequence_start = 0x301B:0x0A;
    gear_reference = 0x301B:0x12;
    ds402_compatible = 0x301B:0x13;
    set_position = 0x301B:0x16;
    sync_tolerance = 0x3022:0x04;
    sync_start = 0x3022:0x05;
    sync_status = 0x3022:0x06;
    gear_denominator = 0x3026:0x03;
    gear_numerator = 0x3026:0x04;
    gear_velocity_limit = 0x3026:0x09;
    gear_denominator_2 = 0x3026:0x0C;
    gear_numerator_2 = 0x3026:0x0D;
    gear_select = 0x3026:0x0E;
    home_clear_limit = 0x3028:0x06;
    home_distance = 0x3028:0x07;
    home_position = 0x3028:0x0B;
    home_index_distance = 0x3028:0x0F;
    jog_method = 0x3029:0x03;
    jog_slow = 0x3029:0x04;
    jog_fast = 0x3029:0x05;
    jog_step = 0x3029:0x07;
    jog_time = 0x3029:0x08;
    sequence_data_set = 0x302D:0x06;
    data_set_number = 0x302D:0x10;
    data_set_type = 0x302D:0x11;
    data_set_a = 0x302D:0x12;
    data_set_b = 0x302D:0x13;
    data_set_c = 0x302D:0x14;
    data_set_d = 0x302D:0x15;
    data_set_transition = 0x302D:0x16;
    data_set_next = 0x302D:0x17;
    data_set_condition = 0x302D:0x18;
    data_set_condition_value = 0x302D:0x19;
    clear_error_memory = 0x303B:0x04;
    memory_number = 0x303C:0x01;
    memory_class = 0x303C:0x02;
    memory_time = 0x303C:0x03;
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
    velocity_window = 0x606D:0;
    torque_target = 0x6071:0;
    position_target = 0x607A:0;
    profile_velocity_limit = 0x607F:0;
    profile_velocity = 0x6081:0;
    profile_acceleration = 0x6083:0;
    torque_slope = 0x6087:0;
    home_method = 0x6098:0;
    home_search_velocity = 0x6099:1;
    home_clear_velocity = 0x6099:2;
    velocity_target = 0x60FF:0;
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
