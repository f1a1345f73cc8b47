//! The rows of the dictionary that the twin gives a meaning to, looked up once.

use super::parameter_sets::is_in_a_set;
use crate::dictionary::LXM32M;
use syncline_canopen::Address;
use syncline_canopen::dictionary::{Dictionary, Entry, Row};

/// The rows that only keep what is written to them, or show what they began with: nothing in the
/// twin depends on them, and nothing changes them. 1xxxh is the CANopen node's.
pub fn storage_only() -> impl Iterator<Item = &'static Entry> {
    let rows = LXM32M.iter().filter(|entry| entry.address.index >= 0x2000);
    rows.filter(|entry| !ADDRESSES.contains(&entry.address) && !is_in_a_set(entry.address))
}

macro_rules! rows {
    ($($name:ident = $index:literal : $sub:literal;)*) => {
        /// Handles of rows, named by what they hold.
        #[derive(Clone, Copy, Debug)]
        pub(super) struct Rows {
            $(pub(super) $name: Row,)*
        }

        /// Where they are.
        const ADDRESSES: &[Address] = &[$(Address::new($index, $sub),)*];

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
    signals_active = 0x301C:0x07;
    signals_latched = 0x301C:0x08;
    warnings_active = 0x301C:0x0B;
    warnings_latched = 0x301C:0x0C;
    store_parameters = 0x3004:0x01;
    reset_parameters = 0x3004:0x08;
    deviation_response = 0x3005:0x0B;
    position_denominator = 0x3006:0x07;
    position_numerator = 0x3006:0x08;
    velocity_denominator = 0x3006:0x21;
    velocity_numerator = 0x3006:0x22;
    ramp_denominator = 0x3006:0x30;
    ramp_numerator = 0x3006:0x31;
    quick_stop_ramp = 0x3006:0x12;
    absolute_needs_reference = 0x3006:0x16;
    quick_stop_option = 0x3006:0x18;
    torque_ramp_enabled = 0x3006:0x2C;
    torque_window = 0x3006:0x2D;
    torque_window_time = 0x3006:0x2E;
    software_limits = 0x3006:0x03;
    limit_at_enabling = 0x3006:0x06;
    hardware_limits_off = 0x3006:0x11;
    brake_release_time = 0x3005:0x07;
    brake_apply_time = 0x3005:0x08;
    ramp_symmetric = 0x3006:0x01;
    ramp_jerk_time = 0x3006:0x0D;
    velocity_ramp_enabled = 0x3006:0x2B;
    torque_source = 0x301B:0x38;
    velocity_source = 0x301B:0x39;
    shutdown_option = 0x605B:0;
    position_option = 0x60F2:0;
    direction_inverted = 0x3006:0x0C;
    deviation_window = 0x3006:0x19;
    velocity_deviation_window = 0x3006:0x1A;
    velocity_threshold = 0x3006:0x1B;
    current_threshold = 0x3006:0x1C;
    window_time = 0x3006:0x1D;
    following_error_limit_user = 0x3006:0x3E;
    deviation_window_user = 0x3006:0x3F;
    standstill_window_user = 0x3006:0x40;
    velocity_deviation_limit_stopping = 0x3006:0x48;
    velocity_deviation_limit = 0x3006:0x4B;
    velocity_deviation_time = 0x3006:0x4C;
    velocity_deviation_response = 0x3005:0x3C;
    velocity_deviation = 0x301E:0x2C;
    internal_limit = 0x301B:0x1E;
    deviation_warning = 0x3006:0x29;
    software_limit_mode = 0x3006:0x47;
    output_0_function = 0x3007:0x09;
    output_1_function = 0x3007:0x0A;
    output_2_function = 0x3007:0x0B;
    inputs_and_outputs = 0x3008:0x01;
    inputs = 0x3008:0x0F;
    outputs = 0x3008:0x10;
    outputs_set = 0x3008:0x11;
    capture_status = 0x300A:0x01;
    capture_1_edge = 0x300A:0x02;
    capture_2_edge = 0x300A:0x03;
    capture_1_start = 0x300A:0x04;
    capture_2_start = 0x300A:0x05;
    capture_1_position = 0x300A:0x06;
    capture_2_position = 0x300A:0x07;
    capture_1_count = 0x300A:0x08;
    capture_2_count = 0x300A:0x09;
    capture_1_count_continuous = 0x300A:0x17;
    capture_1_position_continuous = 0x300A:0x18;
    capture_2_count_continuous = 0x300A:0x19;
    capture_2_position_continuous = 0x300A:0x1A;
    probe_1_rises = 0x300A:0x2B;
    probe_1_falls = 0x300A:0x2C;
    probe_2_rises = 0x300A:0x2D;
    probe_2_falls = 0x300A:0x2E;
    probe_counters = 0x300A:0x2F;
    register_status = 0x300B:0x01;
    register_1_start = 0x300B:0x02;
    register_2_start = 0x300B:0x03;
    register_1_mode = 0x300B:0x04;
    register_2_mode = 0x300B:0x05;
    register_1_a = 0x300B:0x08;
    register_1_b = 0x300B:0x09;
    register_2_a = 0x300B:0x0A;
    register_2_b = 0x300B:0x0B;
    register_3_start = 0x300B:0x0C;
    register_4_start = 0x300B:0x0D;
    register_3_mode = 0x300B:0x0E;
    register_4_mode = 0x300B:0x0F;
    register_3_a = 0x300B:0x12;
    register_3_b = 0x300B:0x13;
    register_4_a = 0x300B:0x14;
    register_4_b = 0x300B:0x15;
    register_group_start = 0x300B:0x16;
    pulse_position = 0x3008:0x05;
    pulse_velocity = 0x3008:0x06;
    speed_filter_actual = 0x3011:0x08;
    friction_speed = 0x3011:0x09;
    acceleration_feed_forward = 0x3011:0x0A;
    current_limit = 0x3011:0x0C;
    quick_stop_current = 0x3011:0x0D;
    halt_current = 0x3011:0x0E;
    velocity_limit = 0x3011:0x10;
    global_gain = 0x3011:0x15;
    halt_option = 0x605D:0;
    parameter_set_copy = 0x3011:0x16;
    parameter_set_active = 0x3011:0x17;
    parameter_set_at_power_up = 0x3011:0x18;
    parameter_set_selected = 0x3011:0x19;
    motor_overload = 0x301C:0x19;
    motor_overload_peak = 0x301C:0x1B;
    drive_overload = 0x301C:0x16;
    drive_overload_peak = 0x301C:0x18;
    bus_voltage = 0x301C:0x0F;
    motor_speed_most = 0x300D:0x04;
    motor_speed_nominal = 0x300D:0x05;
    motor_current_most = 0x300D:0x06;
    motor_current_nominal = 0x300D:0x07;
    motor_torque_nominal = 0x300D:0x08;
    motor_torque_most = 0x300D:0x09;
    motor_voltage_nominal = 0x300D:0x0A;
    motor_voltage_constant = 0x300D:0x0B;
    motor_inertia = 0x300D:0x0C;
    motor_resistance = 0x300D:0x0D;
    motor_inductance_q = 0x300D:0x0E;
    motor_inductance_d = 0x300D:0x0F;
    motor_temperature_most = 0x300D:0x10;
    motor_peak_time = 0x300D:0x11;
    motor_current_stall = 0x300D:0x13;
    motor_pole_pairs = 0x300D:0x14;
    motor_torque_stall = 0x300D:0x16;
    motor_voltage_most = 0x300D:0x19;
    motor_brake = 0x300D:0x20;
    motor_brake_closing = 0x300D:0x21;
    stage_current_nominal = 0x3010:0x01;
    stage_current_most = 0x3010:0x02;
    stage_voltage_most = 0x3010:0x03;
    stage_temperature_warning = 0x3010:0x06;
    stage_temperature_most = 0x3010:0x07;
    resistor_resistance = 0x3010:0x08;
    resistor_power = 0x3010:0x09;
    operating_time = 0x301C:0x0A;
    power = 0x301C:0x0D;
    power_mean = 0x301C:0x0E;
    resistor_overload = 0x301C:0x13;
    resistor_load = 0x301C:0x14;
    resistor_overload_peak = 0x301C:0x15;
    stage_temperature = 0x301C:0x10;
    motor_temperature = 0x301C:0x11;
    device_temperature = 0x301C:0x12;
    stage_load = 0x301C:0x17;
    motor_load = 0x301C:0x1A;
    torque_most = 0x301C:0x1E;
    system_current_most = 0x301C:0x27;
    current_limit_active = 0x301C:0x28;
    velocity_limit_active = 0x301C:0x29;
    current_q = 0x301E:0x01;
    current = 0x301E:0x03;
    voltage_q = 0x301E:0x04;
    phase_voltage = 0x301E:0x06;
    encoder_absolute = 0x301E:0x0F;
    current_q_reference = 0x301E:0x10;
    voltage_used = 0x301E:0x13;
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
    gear_direction = 0x3026:0x05;
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
    sequence_next = 0x302D:0x07;
    sequence_aborted = 0x302D:0x0B;
    sequence_used = 0x302D:0x1F;
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
    data_set_operator = 0x302D:0x1A;
    data_set_condition_2 = 0x302D:0x1C;
    data_set_condition_value_2 = 0x302D:0x1D;
    clear_error_memory = 0x303B:0x04;
    memory_number = 0x303C:0x01;
    memory_class = 0x303C:0x02;
    memory_time = 0x303C:0x03;
    memory_enable_cycles = 0x303C:0x05;
    memory_enable_time = 0x303C:0x06;
    memory_bus_voltage = 0x303C:0x07;
    memory_velocity = 0x303C:0x08;
    memory_current = 0x303C:0x09;
    memory_stage_temperature = 0x303C:0x0A;
    memory_device_temperature = 0x303C:0x0B;
    event_mask_1 = 0x3041:0x0B;
    event_mask_2 = 0x3041:0x0C;
    event_mask_3 = 0x3041:0x0D;
    event_mask_4 = 0x3041:0x0E;
    connection_response = 0x3041:0x11;
    last_error = 0x603F:0;
    controlword = 0x6040:0;
    statusword = 0x6041:0;
    mode = 0x6060:0;
    mode_active = 0x6061:0;
    position_internal = 0x6063:0;
    position = 0x6064:0;
    following_error_limit = 0x6065:0;
    standstill_window = 0x6067:0;
    standstill_window_time = 0x6068:0;
    velocity_reference = 0x606B:0;
    velocity_window = 0x606D:0;
    velocity_window_time = 0x606E:0;
    torque_target = 0x6071:0;
    position_target = 0x607A:0;
    software_limit_negative = 0x607D:1;
    software_limit_positive = 0x607D:2;
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
    probe_function = 0x60B8:0;
    probe_status = 0x60B9:0;
    probe_1_rise = 0x60BA:0;
    probe_1_fall = 0x60BB:0;
    probe_2_rise = 0x60BC:0;
    probe_2_fall = 0x60BD:0;
    setpoint = 0x60C1:1;
    period_value = 0x60C2:1;
    period_index = 0x60C2:2;
    position_deviation = 0x60F4:0;
    reference = 0x301E:0x0C;
    reference_internal = 0x301E:0x09;
    speed = 0x301E:0x08;
    speed_reference = 0x301E:0x07;
    position_deviation_user = 0x301E:0x14;
    load_deviation_peak_user = 0x301E:0x15;
    load_deviation_user = 0x301E:0x16;
    load_deviation_peak = 0x301E:0x1B;
    load_deviation = 0x301E:0x1C;
    loop_velocity_reference = 0x301E:0x1F;
    encoder_1_internal = 0x301E:0x26;
    encoder_1 = 0x301E:0x27;
    encoder_1_speed = 0x301E:0x28;
    encoder_1_velocity = 0x301E:0x29;
    gear_difference = 0x301F:0x0D;
    profile_target = 0x301F:0x01;
    profile_position = 0x301F:0x02;
    profile_velocity_target = 0x301F:0x05;
    feed_forward_velocity = 0x301F:0x07;
    feed_forward_acceleration = 0x301F:0x09;
    position_scale_most = 0x301F:0x0A;
    velocity_scale_most = 0x301F:0x0B;
    ramp_scale_most = 0x301F:0x0C;
}
