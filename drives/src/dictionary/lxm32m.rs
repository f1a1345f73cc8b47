//! The object dictionary of the Lexium 32M with its CANopen module.
//!
//! One row per object, as the fieldbus manual lists them: index, subindex, name, type, access,
//! range, default, unit, PDO mappability; the comment names the line of the manual's text.
//!
//! The manual at hand prints range, default, unit and persistence of only a few 3xxxh and 6xxxh
//! objects. A row without `range` takes what its type holds, a row without `default` starts at 0:
//! neither is a statement of the manual. `assumed` is a default that the twin needs and the
//! manual at hand does not give; `inferred` an access that follows only from the naming rule
//! (a leading underscore is read-only).

use syncline_canopen::dictionary::DataType::{I8, I16, I32, Text, U8, U16, U32};
use syncline_canopen::dictionary::{Entry, ro, rw, table};

/// Units of the loops' objects, all of them assumptions: the manual at hand does not print them.
pub(crate) mod units {
    /// Of a time, s.
    pub(crate) const TIME: f64 = 1e-5;
    /// Of a gain of the position loop, 1/s.
    pub(crate) const POSITION_GAIN: f64 = 0.1;
    /// Of a share.
    pub(crate) const SHARE: f64 = 1e-3;
    /// Of a frequency, Hz.
    pub(crate) const FREQUENCY: f64 = 0.1;
    /// Of a current, A.
    pub(crate) const CURRENT: f64 = 0.01;
    /// Of a gain of the speed loop, A/rpm.
    pub(crate) const SPEED_GAIN: f64 = 1e-4;
    /// A revolution a minute, rev/s.
    pub(crate) const RPM: f64 = 1.0 / 60.0;
}

/// The table, in ascending order.
#[rustfmt::skip]
pub static LXM32M: &[Entry] = &table(keep_settings([
    // 1xxxh: communication profile. Nothing here is stored (lxm32m 2945-4524).
    ro(0x1000, 0, "Device type", U32).default(0x0042_0192),                                          // 2947-2973
    ro(0x1001, 0, "Error register", U8),                                                             // 2975-3008
    rw(0x1003, 0, "Number of errors", U8).range(0, 1).default(1),                                    // 3027-3033
    ro(0x1003, 1, "Error field", U32).default(0),                                                    // 3035-3047
    rw(0x1005, 0, "COB-ID SYNC", U32).default(0x8000_0080),                                          // 3049-3085
    ro(0x1008, 0, "Manufacturer device name", Text(8)),                                              // 3087-3106
    ro(0x1009, 0, "Manufacturer hardware version", Text(8)),                                         // 3108-3128
    ro(0x100A, 0, "Manufacturer software version", Text(8)),                                         // 3130-3149
    rw(0x100C, 0, "Guard time", U16).range(0, 65535).default(0).unit("ms"),                          // 3151-3174
    rw(0x100D, 0, "Life time factor", U8).range(0, 255).default(0),                                  // 3176-3205
    rw(0x1014, 0, "COB-ID EMCY", U32).default_plus_node(0x4000_0080),                                // 3207-3237
    rw(0x1015, 0, "Inhibit time EMCY", U16).range(0, 65535).default(0).unit("100 us"),               // 3239-3258
    ro(0x1016, 0, "Consumer heartbeat: number", U8).default(3),                                      // 3273-3280
    rw(0x1016, 1, "Consumer heartbeat time 1", U32).default(0),                                      // 3282-3297
    rw(0x1016, 2, "Consumer heartbeat time 2", U32).default(0),                                      // 3290
    rw(0x1016, 3, "Consumer heartbeat time 3", U32).default(0),                                      // 3290
    rw(0x1017, 0, "Producer heartbeat time", U16).range(0, 65535).default(0).unit("ms"),             // 3299-3320
    ro(0x1018, 0, "Identity: number", U8).default(3),                                                // 3340-3346
    ro(0x1018, 1, "Vendor ID", U32).default(0x0800_005A),                                            // 3348-3354
    ro(0x1018, 2, "Product code", U32),                                                              // 3356-3362
    ro(0x1018, 3, "Revision number", U32),                                                           // 3364-3370
    ro(0x1029, 0, "Error behaviour: number", U8).default(1),                                         // 3385-3391
    rw(0x1029, 1, "Communication error", U8).range(0, 2).default(0),                                 // 3393-3406
    ro(0x1200, 0, "1st server SDO: number", U8).default(2),                                          // 3421-3427
    ro(0x1200, 1, "COB-ID client to server", U32).default_plus_node(0x600),                          // 3429-3435
    ro(0x1200, 2, "COB-ID server to client", U32).default_plus_node(0x580),                          // 3437-3443
    ro(0x1201, 0, "2nd server SDO: number", U8).default(3),                                          // 3458-3464
    rw(0x1201, 1, "COB-ID client to server", U32).default(0x8000_0000),                              // 3466-3472
    rw(0x1201, 2, "COB-ID server to client", U32).default(0x8000_0000),                              // 3474-3481
    rw(0x1201, 3, "Node-ID of SDO client", U32).range(1, 127),                                       // 3483-3489
    ro(0x1400, 0, "R_PDO1 parameter: number", U8).default(2),                                        // 3504-3510
    rw(0x1400, 1, "COB-ID R_PDO1", U32).default_plus_node(0x0000_0200),                              // 3512-3518
    rw(0x1400, 2, "Transmission type R_PDO1", U8).range(0, 255).default(255),                        // 3520-3526
    ro(0x1401, 0, "R_PDO2 parameter: highest sub", U8).default(2),                                   // 3589-3595
    rw(0x1401, 1, "COB-ID R_PDO2", U32).default_plus_node(0x8000_0300),                              // 3597-3603
    rw(0x1401, 2, "Transmission type R_PDO2", U8).range(0, 255).default(255),                        // 3605-3611
    ro(0x1402, 0, "R_PDO3 parameter: highest sub", U8).default(2),                                   // 3645-3651
    rw(0x1402, 1, "COB-ID R_PDO3", U32).default_plus_node(0x8000_0400),                              // 3653-3659
    rw(0x1402, 2, "Transmission type R_PDO3", U8).range(0, 255).default(255),                        // 3661-3667
    ro(0x1403, 0, "R_PDO4 parameter: highest sub", U8).default(2),                                   // 3701-3707
    rw(0x1403, 1, "COB-ID R_PDO4", U32).default_plus_node(0x8000_0500),                              // 3709-3715
    ro(0x1403, 2, "Transmission type R_PDO4", U8).default(254),                                      // 3717-3723
    rw(0x1600, 0, "R_PDO1 mapping: number", U8).range(0, 4).default(1),                              // 3746-3752
    rw(0x1600, 1, "1st mapped object", U32).default(0x6040_0010),                                    // 3754-3760
    rw(0x1600, 2, "2nd mapped object", U32),                                                         // 3762-3768
    rw(0x1600, 3, "3rd mapped object", U32),                                                         // 3770-3777
    rw(0x1600, 4, "4th mapped object", U32),                                                         // 3779-3785
    rw(0x1601, 0, "R_PDO2 mapping: number", U8).range(0, 4).default(2),                              // 3815-3821
    rw(0x1601, 1, "1st mapped object", U32).default(0x6040_0010),                                    // 3823-3830
    rw(0x1601, 2, "2nd mapped object", U32).default(0x607A_0020),                                    // 3832-3838
    rw(0x1601, 3, "3rd mapped object", U32),                                                         // 3840-3846
    rw(0x1601, 4, "4th mapped object", U32),                                                         // 3848-3854
    rw(0x1602, 0, "R_PDO3 mapping: number", U8).range(0, 4).default(2),                              // 3878-3884
    rw(0x1602, 1, "1st mapped object", U32).default(0x6040_0010),                                    // 3886-3892
    rw(0x1602, 2, "2nd mapped object", U32).default(0x60FF_0020),                                    // 3894-3900
    rw(0x1602, 3, "3rd mapped object", U32),                                                         // 3902-3908
    rw(0x1602, 4, "4th mapped object", U32),                                                         // 3910-3916
    rw(0x1603, 0, "R_PDO4 mapping: number", U8).range(0, 4).default(0),                              // 3940-3946
    rw(0x1603, 1, "1st mapped object", U32),                                                         // 3948-3954
    rw(0x1603, 2, "2nd mapped object", U32),                                                         // 3956-3962
    rw(0x1603, 3, "3rd mapped object", U32),                                                         // 3964-3970
    rw(0x1603, 4, "4th mapped object", U32),                                                         // 3972-3978
    ro(0x1800, 0, "T_PDO1 parameter: number", U8).default(5),                                        // 3999-4005
    rw(0x1800, 1, "COB-ID T_PDO1", U32).default_plus_node(0x4000_0180),                              // 4007-4013
    rw(0x1800, 2, "Transmission type T_PDO1", U8).range(0, 255).default(255),                        // 4015-4021
    rw(0x1800, 3, "Inhibit time T_PDO1", U16).range(0, 65535).default(0),                            // 4023-4029
    rw(0x1800, 4, "Reserved T_PDO1", U8).range(0, 255),                                              // 4031-4037
    rw(0x1800, 5, "Event timer T_PDO1", U16).range(0, 65535).default(0),                             // 4039-4045
    ro(0x1801, 0, "T_PDO2 parameter: highest sub", U8).default(5),                                   // 4072-4078
    rw(0x1801, 1, "COB-ID T_PDO2", U32).default_plus_node(0xC000_0280),                              // 4080-4086
    rw(0x1801, 2, "Transmission type T_PDO2", U8).range(0, 255).default(255),                        // 4088-4094
    rw(0x1801, 3, "Inhibit time T_PDO2", U16).range(0, 65535).default(0),                            // 4096-4102
    rw(0x1801, 4, "Reserved T_PDO2", U8).range(0, 255),                                              // 4104-4110
    rw(0x1801, 5, "Event timer T_PDO2", U16).range(0, 65535).default(100),                           // 4112-4119
    ro(0x1802, 0, "T_PDO3 parameter: highest sub", U8).default(5),                                   // 4147-4153
    rw(0x1802, 1, "COB-ID T_PDO3", U32).default_plus_node(0xC000_0380),                              // 4155-4161
    rw(0x1802, 2, "Transmission type T_PDO3", U8).range(0, 255).default(255),                        // 4163-4170
    rw(0x1802, 3, "Inhibit time T_PDO3", U16).range(0, 65535).default(0),                            // 4172-4178
    rw(0x1802, 4, "Reserved T_PDO3", U8).range(0, 255),                                              // 4180-4186
    rw(0x1802, 5, "Event timer T_PDO3", U16).range(0, 65535).default(100),                           // 4188-4194
    ro(0x1803, 0, "T_PDO4 parameter: highest sub", U8).default(5),                                   // 4222-4228
    rw(0x1803, 1, "COB-ID T_PDO4", U32).default_plus_node(0xC000_0480),                              // 4230-4236
    ro(0x1803, 2, "Transmission type T_PDO4", U8).range(0, 255).default(254),                        // 4238-4244
    rw(0x1803, 3, "Inhibit time T_PDO4", U16).range(0, 65535).default(0),                            // 4246-4252
    ro(0x1803, 4, "Reserved T_PDO4", U8).range(0, 255),                                              // 4254-4260
    rw(0x1803, 5, "Event timer T_PDO4", U16).range(0, 65535).default(0),                             // 4262-4269
    rw(0x1A00, 0, "T_PDO1 mapping: number", U8).range(0, 4).default(1),                              // 4292-4298
    rw(0x1A00, 1, "1st mapped object", U32).default(0x6041_0010),                                    // 4300-4306
    rw(0x1A00, 2, "2nd mapped object", U32),                                                         // 4308-4314
    rw(0x1A00, 3, "3rd mapped object", U32),                                                         // 4316-4323
    rw(0x1A00, 4, "4th mapped object", U32),                                                         // 4325-4331
    rw(0x1A01, 0, "T_PDO2 mapping: number", U8).range(0, 4).default(2),                              // 4354-4360
    rw(0x1A01, 1, "1st mapped object", U32).default(0x6041_0010),                                    // 4362-4369
    rw(0x1A01, 2, "2nd mapped object", U32).default(0x6064_0020),                                    // 4371-4377
    rw(0x1A01, 3, "3rd mapped object", U32),                                                         // 4379-4385
    rw(0x1A01, 4, "4th mapped object", U32),                                                         // 4387-4393
    rw(0x1A02, 0, "T_PDO3 mapping: number", U8).range(0, 4).default(2),                              // 4417-4423
    rw(0x1A02, 1, "1st mapped object", U32).default(0x6041_0010),                                    // 4425-4431
    rw(0x1A02, 2, "2nd mapped object", U32).default(0x606C_0020),                                    // 4433-4439
    rw(0x1A02, 3, "3rd mapped object", U32),                                                         // 4441-4447
    rw(0x1A02, 4, "4th mapped object", U32),                                                         // 4449-4455
    rw(0x1A03, 0, "T_PDO4 mapping: number", U8).range(0, 4).default(0),                              // 4479-4485
    rw(0x1A03, 1, "1st mapped object", U32),                                                         // 4487-4493
    rw(0x1A03, 2, "2nd mapped object", U32),                                                         // 4495-4501
    rw(0x1A03, 3, "3rd mapped object", U32),                                                         // 4503-4509
    rw(0x1A03, 4, "4th mapped object", U32),                                                         // 4511-4518
    // 3xxxh: manufacturer specific (lxm32m 2151-2891).
    ro(0x3001, 0x01, "_prgNoDEV", U32).inferred(),                                                   // 2158  Device firmware: program number
    ro(0x3001, 0x02, "_prgVerDEV", U16).inferred(),                                                  // 2159  Device firmware: version
    ro(0x3001, 0x04, "_prgRevDEV", U16).inferred(),                                                  // 2160  Device firmware: revision
    ro(0x3001, 0x0C, "_AccessInfo", U16).t_pdo().inferred(),                                         // 2161  Which access channel currently holds control
    rw(0x3001, 0x0D, "AccessExcl", U16).inferred(),                                                  // 2162  Claim exclusive control for an access channel
    rw(0x3001, 0x0E, "AccessLock", U16).inferred(),                                                  // 2165  Lock out the other access channels
    rw(0x3001, 0x43, "UsrAppDataMem1", U32).inferred(),                                              // 2166  Free user data word 1
    rw(0x3001, 0x44, "UsrAppDataMem2", U32).inferred(),                                              // 2167  Free user data word 2
    ro(0x3002, 0x12, "_hwVersCPU", U16).t_pdo().inferred(),                                          // 2168  Hardware version, control board
    ro(0x3002, 0x14, "_hwVersPS", U16).t_pdo().inferred(),                                           // 2169  Hardware version, power stage
    ro(0x3002, 0x15, "_ModuleSlot1", U16).t_pdo().inferred(),                                        // 2170  Module fitted in slot 1
    ro(0x3002, 0x16, "_hwVersSlot1", U16).t_pdo().inferred(),                                        // 2171  Hardware version of slot 1 module
    ro(0x3002, 0x17, "_fwNoSlot1", U32).t_pdo().inferred(),                                          // 2172  Firmware number, slot 1
    ro(0x3002, 0x18, "_fwVersSlot1", U16).t_pdo().inferred(),                                        // 2173  Firmware version, slot 1
    ro(0x3002, 0x19, "_fwRevSlot1", U16).t_pdo().inferred(),                                         // 2174  Firmware revision, slot 1
    ro(0x3002, 0x1A, "_ModuleSlot2", U16).t_pdo().inferred(),                                        // 2175  Module fitted in slot 2
    ro(0x3002, 0x1B, "_hwVersSlot2", U16).t_pdo().inferred(),                                        // 2176  Hardware version of slot 2 module
    ro(0x3002, 0x1C, "_fwNoSlot2", U32).inferred(),                                                  // 2177  Firmware number, slot 2
    ro(0x3002, 0x1D, "_fwVersSlot2", U16).t_pdo().inferred(),                                        // 2178  Firmware version, slot 2
    ro(0x3002, 0x1E, "_fwRevSlot2", U16).t_pdo().inferred(),                                         // 2179  Firmware revision, slot 2
    ro(0x3002, 0x1F, "_ModuleSlot3", U16).t_pdo().inferred(),                                        // 2180  Module fitted in slot 3
    ro(0x3002, 0x20, "_hwVersSlot3", U16).t_pdo().inferred(),                                        // 2181  Hardware version of slot 3 module
    ro(0x3002, 0x21, "_fwNoSlot3", U32).t_pdo().inferred(),                                          // 2182  Firmware number, slot 3
    ro(0x3002, 0x22, "_fwVersSlot3", U16).t_pdo().inferred(),                                        // 2183  Firmware version, slot 3
    ro(0x3002, 0x23, "_fwRevSlot3", U16).t_pdo().inferred(),                                         // 2184  Firmware revision, slot 3
    ro(0x3002, 0x24, "_fwNoSlot3FPGA", U32).inferred(),                                              // 2185  Firmware number, slot 3 FPGA
    ro(0x3002, 0x25, "_fwVersSlot3FPGA", U16).inferred(),                                            // 2186  Firmware version, slot 3 FPGA
    ro(0x3002, 0x26, "_fwRevSlot3FPGA", U16).inferred(),                                             // 2187  Firmware revision, slot 3 FPGA
    ro(0x3002, 0x27, "_fwNoSlot3Boot", U32).inferred(),                                              // 2188  Firmware number, slot 3 bootloader
    ro(0x3002, 0x28, "_fwVersSlot3Boot", U16).inferred(),                                            // 2189  Firmware version, slot 3 bootloader
    ro(0x3002, 0x29, "_fwRevSlot3Boot", U16).inferred(),                                             // 2190  Firmware revision, slot 3 bootloader
    rw(0x3004, 0x01, "PAReprSave", U16).inferred(),                                                  // 2191  Store parameter values to non-volatile memory (trigger)
    rw(0x3004, 0x07, "PAR_CTRLreset", U16).inferred(),                                               // 2192  Reset control-loop parameters (trigger)
    rw(0x3004, 0x08, "PARUserReset", U16).inferred(),                                                // 2193  Reset user parameters (trigger)
    rw(0x3004, 0x14, "PAR_ScalingStart", U16).inferred(),                                            // 2194  Start recalculation of parameters held in user units
    ro(0x3004, 0x15, "_PAR_ScalingState", U16).t_pdo().inferred(),                                   // 2195  State of that recalculation
    ro(0x3004, 0x16, "_PAR_ScalingError", U32).t_pdo().inferred(),                                   // 2196  Extra information on an error found during recalculation
    rw(0x3004, 0x1D, "MON_ConfModification", U16).inferred(),                                        // 2197  Setup of configuration-change monitoring
    rw(0x3005, 0x01, "DEVcmdinterf", U16).inferred(),                                                // 2198  Control mode (local I/O versus fieldbus) - values not in seed
    rw(0x3005, 0x02, "PTI_signal_type", U16).inferred(),                                             // 2199  Reference signal type at the PTI interface
    rw(0x3005, 0x03, "IOdefaultMode", U16).inferred(),                                               // 2200  Default operating mode for local (I/O) control
    rw(0x3005, 0x04, "IO_AutoEnaConfig", U16).inferred(),                                            // 2201  Power stage enable per IO_AutoEnable also after a detected error
    rw(0x3005, 0x05, "MON_commutat", U16).inferred(),                                                // 2202  Commutation monitoring
    rw(0x3005, 0x06, "IO_AutoEnable", U16).inferred(),                                               // 2203  Enable power stage at power-up
    rw(0x3005, 0x07, "BRK_AddT_release", I16).inferred(),                                            // 2204  Extra delay when releasing (opening) the holding brake
    rw(0x3005, 0x08, "BRK_AddT_apply", I16).inferred(),                                              // 2205  Extra delay when applying (closing) the holding brake
    rw(0x3005, 0x09, "RESint_ext", U16).inferred(),                                                  // 2208  Braking resistor selection: internal/external
    rw(0x3005, 0x0A, "ErrorResp_Flt_AC", U16).inferred(),                                            // 2209  Error response: missing mains phase
    rw(0x3005, 0x0B, "ErrorResp_p_dif", U16).assumed(3).inferred(),                                  // 2210  Error response: excessive load-dependent position deviation
    rw(0x3005, 0x0E, "PWM_fChop", U16).inferred(),                                                   // 2211  Power stage PWM frequency
    rw(0x3005, 0x0F, "MON_MainsVolt", U16).inferred(),                                               // 2212  Detection and monitoring of mains phases
    rw(0x3005, 0x10, "MON_GroundFault", U16).inferred(),                                             // 2213  Ground fault monitoring
    rw(0x3005, 0x11, "RESExt_ton", U16).inferred(),                                                  // 2214  External braking resistor: maximum permitted on-time
    rw(0x3005, 0x12, "RESExt_P", U16).inferred(),                                                    // 2215  External braking resistor: nominal power
    rw(0x3005, 0x13, "RESExt_R", U16).inferred(),                                                    // 2216  External braking resistor: resistance
    rw(0x3005, 0x15, "ESIM_scale", U16).inferred(),                                                  // 2217  Encoder simulation resolution
    rw(0x3005, 0x16, "ENC1_adjustment", I32).inferred(),                                             // 2218  Adjust absolute position of encoder 1
    rw(0x3005, 0x17, "IO_GEARmethod", U16).inferred(),                                               // 2219  Processing type for Electronic Gear under local control
    rw(0x3005, 0x18, "IO_JOGmethod", U16).inferred(),                                                // 2220  Jog method under local control
    rw(0x3005, 0x1F, "PTO_mode", U16).inferred(),                                                    // 2221  Use of the PTO interface
    rw(0x3005, 0x20, "Mains_reactor", U16).inferred(),                                               // 2222  Mains reactor fitted
    rw(0x3005, 0x21, "ShiftEncWorkRang", U16).inferred(),                                            // 2223  Shift the encoder working range
    rw(0x3005, 0x22, "ErrorResp_I2tRES", U16).inferred(),                                            // 2224  Error response: braking resistor I2t at 100 %
    rw(0x3005, 0x23, "SimAbsolutePos", U16).inferred(),                                              // 2225  Simulate absolute position across power cycles
    rw(0x3005, 0x24, "ENC2_adjustment", I32).inferred(),                                             // 2226  Adjust absolute position of encoder 2
    rw(0x3005, 0x25, "ENC_abs_source", U16).inferred(),                                              // 2227  Source used when setting the encoder absolute position
    rw(0x3005, 0x26, "DCbus_compat", U16).inferred(),                                                // 2228  DC bus compatibility LXM32 / ATV32
    rw(0x3005, 0x2F, "PTI_pulse_filter", U16).inferred(),                                            // 2229  Filter time for PTI inputs
    rw(0x3005, 0x32, "ESIM_HighResolution", U32).inferred(),                                         // 2230  Encoder simulation: high resolution
    rw(0x3005, 0x33, "ESIM_PhaseShift", I16).inferred(),                                             // 2231  Encoder simulation: phase shift of pulse output
    rw(0x3005, 0x34, "IO_FaultResOnEnalnp", U16).inferred(),                                         // 2232  Additional fault reset through the Enable signal input function
    rw(0x3005, 0x38, "IO_PTtq_reference", U16).inferred(),                                           // 2233  Reference source for Profile Torque under local control
    rw(0x3005, 0x39, "DplParChCheckDataTyp", U16).inferred(),                                        // 2234  Drive Profile Lexium: data type check on write access
    rw(0x3005, 0x3A, "ErrorResp_QuasiAbs", U16).inferred(),                                          // 2235  Error response: quasi-absolute position error
    rw(0x3005, 0x3B, "ErrorResp_PDifEncM", U16).inferred(),                                          // 2236  Error response: deviation motor encoder / machine encoder too large
    rw(0x3005, 0x3C, "ErrorResp_v_dif", U16).assumed(3).inferred(),                                  // 2237  Error response: excessive load-dependent velocity deviation
    rw(0x3005, 0x3D, "MON_DCbusVdcThresh", U16).inferred(),                                          // 2238  DC bus overvoltage monitoring threshold
    rw(0x3005, 0x3E, "CommutCntCred", I16).inferred(),                                               // 2239  Value for raised threshold of commutation monitoring
    rw(0x3006, 0x01, "RAMP_v_sym", U16).r_pdo().inferred(),                                          // 2240  Velocity profile: acceleration and deceleration together
    rw(0x3006, 0x02, "RAMPaccdec", U32).inferred(),                                                  // 2241  Acceleration/deceleration for Drive Profile Lexium
    rw(0x3006, 0x03, "MON_SW_Limits", U16).inferred(),                                               // 2242  Activate software limit switches
    rw(0x3006, 0x06, "IOsigRespOfPS", U16).inferred(),                                               // 2243  Response to an active limit switch when the power stage is enabled
    rw(0x3006, 0x07, "ScalePOSdenom", I32).assumed(16384).inferred(),                                // 2244  Position scaling: denominator
    rw(0x3006, 0x08, "ScalePOSnum", I32).assumed(1).inferred(),                                      // 2245  Position scaling: numerator
    rw(0x3006, 0x0C, "InvertDirOfMove", U16).inferred(),                                             // 2246  Invert direction of movement
    rw(0x3006, 0x0D, "RAMP_v_jerk", U16).inferred(),                                                 // 2249  Velocity profile: jerk limit
    rw(0x3006, 0x0E, "IOsigREF", U16).inferred(),                                                    // 2250  Signal evaluation of reference switch
    rw(0x3006, 0x0F, "IOsigLIMN", U16).inferred(),                                                   // 2251  Signal evaluation of negative limit switch
    rw(0x3006, 0x10, "IOsigLIMP", U16).inferred(),                                                   // 2252  Signal evaluation of positive limit switch
    rw(0x3006, 0x11, "MON_HW_Limits", U16).inferred(),                                               // 2253  Temporarily disable hardware limit switches
    rw(0x3006, 0x12, "RAMPquickstop", U32).assumed(6000).inferred(),                                 // 2254  Quick Stop deceleration ramp
    rw(0x3006, 0x16, "AbsHomeRequest", U16).inferred(),                                              // 2255  Absolute positioning only after homing
    rw(0x3006, 0x18, "LIM_QStopReact", I16).assumed(6).inferred(),                                   // 2256  Quick Stop option code (takes the place of DS402 605Ah, which is not listed)
    rw(0x3006, 0x19, "MON_p_DiffWin", U16).inferred(),                                               // 2257  Position deviation monitoring window
    rw(0x3006, 0x1A, "MON_v_DiffWin", U32).inferred(),                                               // 2258  Velocity deviation monitoring window
    rw(0x3006, 0x1B, "MON_v_Threshold", U32).r_pdo().inferred(),                                     // 2259  Velocity threshold monitoring
    rw(0x3006, 0x1C, "MON_I_Threshold", U16).r_pdo().inferred(),                                     // 2260  Current threshold monitoring
    rw(0x3006, 0x1D, "MON_ChkTime", U16).inferred(),                                                 // 2261  Monitoring time window
    rw(0x3006, 0x1E, "IO_v_limit", U32).inferred(),                                                  // 2262  Velocity limit via signal input
    rw(0x3006, 0x21, "ScaleVELdenom", I32).assumed(1).inferred(),                                    // 2263  Velocity scaling: denominator
    rw(0x3006, 0x22, "ScaleVELnum", I32).assumed(1).inferred(),                                      // 2264  Velocity scaling: numerator
    rw(0x3006, 0x26, "MON_p_winTout", U16).inferred(),                                               // 2265  Timeout for standstill window monitoring
    rw(0x3006, 0x27, "IO_I_limit", U16).inferred(),                                                  // 2266  Current limit via signal input
    rw(0x3006, 0x28, "MON_v_zeroclamp", U32).inferred(),                                             // 2267  Velocity limit for Zero Clamp
    rw(0x3006, 0x29, "MON_p_dif_warn", U16).inferred(),                                              // 2268  Advisory limit of load-dependent position deviation (error class 0)
    rw(0x3006, 0x2B, "RAMP_v_enable", U16).assumed(1).inferred(),                                    // 2269  Activate the velocity motion profile
    rw(0x3006, 0x2C, "RAMP_tq_enable", U16).inferred(),                                              // 2270  Activate the torque motion profile
    rw(0x3006, 0x2D, "MON_tq_win", U16).assumed(30).inferred(),                                      // 2271  Torque window: permitted deviation
    rw(0x3006, 0x2E, "MON_tq_winTime", U16).assumed(0).inferred(),                                   // 2272  Torque window: time
    rw(0x3006, 0x2F, "IO_ModeSwitch", U16).inferred(),                                               // 2273  Operating mode selected by the mode-switch signal input function
    rw(0x3006, 0x30, "ScaleRAMPdenom", I32).assumed(1).inferred(),                                   // 2274  Ramp scaling: denominator
    rw(0x3006, 0x31, "ScaleRAMPnum", I32).assumed(1).inferred(),                                     // 2275  Ramp scaling: numerator
    rw(0x3006, 0x38, "MOD_Enable", U16).inferred(),                                                  // 2276  Modulo function on/off
    rw(0x3006, 0x39, "MOD_Min", I32).inferred(),                                                     // 2277  Modulo range minimum position
    rw(0x3006, 0x3A, "MOD_Max", I32).inferred(),                                                     // 2278  Modulo range maximum position
    rw(0x3006, 0x3B, "MOD_AbsDirection", U16).inferred(),                                            // 2279  Direction of absolute movement with modulo
    rw(0x3006, 0x3C, "MOD_AbsMultiRng", U16).inferred(),                                             // 2280  Multiple ranges for absolute movement with modulo
    rw(0x3006, 0x3D, "CompParSyncMot", U16).inferred(),                                              // 1630  written by the interpolated position set-up, not listed
    rw(0x3006, 0x3E, "MON_p_dif_load_usr", I32).assumed(16384).inferred(),                           // 2281  Maximum load-dependent position deviation
    rw(0x3006, 0x3F, "MON_p_DiffWin_usr", I32).inferred(),                                           // 2282  Position deviation monitoring window
    rw(0x3006, 0x40, "MON_p_win_usr", I32).assumed(16).inferred(),                                   // 2283  Standstill window: permitted control deviation
    rw(0x3006, 0x41, "BLSH_Mode", U16).inferred(),                                                   // 2284  Backlash compensation: processing mode
    rw(0x3006, 0x42, "BLSH_Position", I32).inferred(),                                               // 2285  Backlash compensation: position value
    rw(0x3006, 0x44, "BLSH_Time", U16).inferred(),                                                   // 2286  Backlash compensation: processing time
    rw(0x3006, 0x47, "MON_SWLimMode", U16).inferred(),                                               // 2287  Behaviour on reaching a position limit
    rw(0x3006, 0x48, "MON_VelDiffOpSt578", U32).inferred(),                                          // 2288  Maximum load-dependent velocity deviation for operating states 5, 7 and 8
    rw(0x3006, 0x49, "ResWriComNotOpEn", U16).inferred(),                                            // 2291  Response to a write command while the operating state is not Operation Enabled
    rw(0x3006, 0x4B, "MON_VelDiff", U32).inferred(),                                                 // 2292  Maximum load-dependent velocity deviation
    rw(0x3006, 0x4C, "MON_VelDiff_Time", U16).inferred(),                                            // 2293  Time window for maximum load-dependent velocity deviation
    rw(0x3007, 0x01, "IOfunc_DI0", U16).inferred(),                                                  // 2294  Function of input DI0
    rw(0x3007, 0x02, "IOfunc_DI1", U16).inferred(),                                                  // 2295  Function of input DI1
    rw(0x3007, 0x03, "IOfunc_DI2", U16).inferred(),                                                  // 2296  Function of input DI2
    rw(0x3007, 0x04, "IOfunc_DI3", U16).inferred(),                                                  // 2297  Function of input DI3
    rw(0x3007, 0x05, "IOfunc_DI4", U16).inferred(),                                                  // 2298  Function of input DI4
    rw(0x3007, 0x06, "IOfunc_DI5", U16).inferred(),                                                  // 2299  Function of input DI5
    rw(0x3007, 0x09, "IOfunc_DQ0", U16).assumed(2).inferred(),                                       // 2300  Function of output DQ0
    rw(0x3007, 0x0A, "IOfunc_DQ1", U16).assumed(3).inferred(),                                       // 2301  Function of output DQ1
    rw(0x3007, 0x0B, "IOfunc_DQ2", U16).assumed(1).inferred(),                                       // 2302  Function of output DQ2
    ro(0x3008, 0x01, "_IO_act", U16).t_pdo().inferred(),                                             // 2303  Physical state of digital inputs and outputs
    ro(0x3008, 0x05, "_p_PTI_act", I32).t_pdo().inferred(),                                          // 2304  Actual position at PTI interface
    ro(0x3008, 0x06, "_v_PTI_act", I32).t_pdo().inferred(),                                          // 2305  Actual velocity at PTI interface
    rw(0x3008, 0x07, "InvertDirOfCount", U16).inferred(),                                            // 2306  Invert counting direction at PTI interface
    rw(0x3008, 0x0A, "BRK_release", U16).inferred(),                                                 // 2307  Manual operation of holding brake
    ro(0x3008, 0x0F, "_IO_DI_act", U16).t_pdo().inferred(),                                          // 2308  State of digital inputs
    ro(0x3008, 0x10, "_IO_DQ_act", U16).t_pdo().inferred(),                                          // 2309  State of digital outputs
    rw(0x3008, 0x11, "IO_DQ_set", U16).r_pdo().inferred(),                                           // 2310  Set digital outputs directly
    rw(0x3008, 0x20, "DI_0_Debounce", U16).inferred(),                                               // 2311  Debounce time DI0
    rw(0x3008, 0x21, "DI_1_Debounce", U16).inferred(),                                               // 2312  Debounce time DI1
    rw(0x3008, 0x22, "DI_2_Debounce", U16).inferred(),                                               // 2313  Debounce time DI2
    rw(0x3008, 0x23, "DI_3_Debounce", U16).inferred(),                                               // 2314  Debounce time DI3
    rw(0x3008, 0x24, "DI_4_Debounce", U16).inferred(),                                               // 2315  Debounce time DI4
    rw(0x3008, 0x25, "DI_5_Debounce", U16).inferred(),                                               // 2316  Debounce time DI5
    ro(0x3008, 0x26, "_IO_STO_act", U16).t_pdo().inferred(),                                         // 2317  State of the STO safety inputs
    rw(0x3008, 0x27, "IOsigVelLim", U16).inferred(),                                                 // 2318  Signal evaluation for the Velocity Limitation input function
    rw(0x3008, 0x28, "IOsigCurrLim", U16).inferred(),                                                // 2319  Signal evaluation for the Current Limitation input function
    rw(0x3008, 0x29, "p_PTI_act_set", I32).inferred(),                                               // 2320  Position value at PTI interface (settable)
    ro(0x300A, 0x01, "_CapStatus", U16).t_pdo().inferred(),                                          // 2321  State of the capture inputs
    rw(0x300A, 0x02, "Cap1Config", U16).inferred(),                                                  // 2322  Capture input 1: configuration
    rw(0x300A, 0x03, "Cap2Config", U16).inferred(),                                                  // 2323  Capture input 2: configuration
    rw(0x300A, 0x04, "Cap1Activate", U16).inferred(),                                                // 2324  Capture input 1: start/stop
    rw(0x300A, 0x05, "Cap2Activate", U16).inferred(),                                                // 2325  Capture input 2: start/stop
    ro(0x300A, 0x06, "_Cap1Pos", I32).t_pdo().inferred(),                                            // 2326  Capture input 1: captured position (one-time)
    ro(0x300A, 0x07, "_Cap2Pos", I32).t_pdo().inferred(),                                            // 2327  Capture input 2: captured position (one-time)
    ro(0x300A, 0x08, "_Cap1Count", U16).t_pdo().inferred(),                                          // 2328  Capture input 1: event counter (one-time)
    ro(0x300A, 0x09, "_Cap2Count", U16).t_pdo().inferred(),                                          // 2329  Capture input 2: event counter (one-time)
    rw(0x300A, 0x0A, "Cap1Source", U16).inferred(),                                                  // 2330  Capture input 1: encoder source
    rw(0x300A, 0x0B, "Cap2Source", U16).inferred(),                                                  // 2331  Capture input 2: encoder source
    rw(0x300A, 0x11, "Cap3Config", U16).inferred(),                                                  // 2334  Capture input 3: configuration
    rw(0x300A, 0x12, "Cap3Activate", U16).inferred(),                                                // 2335  Capture input 3: start/stop
    ro(0x300A, 0x13, "_Cap3Pos", I32).t_pdo().inferred(),                                            // 2336  Capture input 3: captured position (one-time)
    ro(0x300A, 0x14, "_Cap3Count", U16).t_pdo().inferred(),                                          // 2337  Capture input 3: event counter (one-time)
    rw(0x300A, 0x15, "Cap3Source", U16).inferred(),                                                  // 2338  Capture input 3: encoder source
    ro(0x300A, 0x17, "_Cap1CountCons", U16).t_pdo().inferred(),                                      // 2339  Capture input 1: event counter (continuous)
    ro(0x300A, 0x18, "_Cap1PosCons", I32).t_pdo().inferred(),                                        // 2340  Capture input 1: captured position (continuous)
    ro(0x300A, 0x19, "_Cap2CountCons", U16).t_pdo().inferred(),                                      // 2341  Capture input 2: event counter (continuous)
    ro(0x300A, 0x1A, "_Cap2PosCons", I32).t_pdo().inferred(),                                        // 2342  Capture input 2: captured position (continuous)
    ro(0x300A, 0x1B, "_Cap3CountCons", U16).t_pdo().inferred(),                                      // 2343  Capture input 3: event counter (continuous)
    ro(0x300A, 0x1C, "_Cap3PosCons", I32).t_pdo().inferred(),                                        // 2344  Capture input 3: captured position (continuous)
    ro(0x300A, 0x2B, "_Cap1CntRise", U16).t_pdo().inferred(),                                        // 2345  Capture input 1: rising-edge event counter (DS402)
    ro(0x300A, 0x2C, "_Cap1CntFall", U16).t_pdo().inferred(),                                        // 2346  Capture input 1: falling-edge event counter (DS402)
    ro(0x300A, 0x2D, "_Cap2CntRise", U16).t_pdo().inferred(),                                        // 2347  Capture input 2: rising-edge event counter (DS402)
    ro(0x300A, 0x2E, "_Cap2CntFall", U16).t_pdo().inferred(),                                        // 2348  Capture input 2: falling-edge event counter (DS402)
    ro(0x300A, 0x2F, "_CapEventCounters", U16).t_pdo().inferred(),                                   // 2349  Capture inputs 1 and 2: combined event counters (DS402)
    ro(0x300B, 0x01, "_PosRegStatus", U16).t_pdo().inferred(),                                       // 2350  Position register: channel status
    rw(0x300B, 0x02, "PosReg1Start", U16).r_pdo().inferred(),                                        // 2351  Position register channel 1: start/stop
    rw(0x300B, 0x03, "PosReg2Start", U16).r_pdo().inferred(),                                        // 2352  Position register channel 2: start/stop
    rw(0x300B, 0x04, "PosReg1Mode", U16).inferred(),                                                 // 2353  Position register channel 1: comparison criterion
    rw(0x300B, 0x05, "PosReg2Mode", U16).inferred(),                                                 // 2354  Position register channel 2: comparison criterion
    rw(0x300B, 0x06, "PosReg1Source", U16).inferred(),                                               // 2355  Position register channel 1: source
    rw(0x300B, 0x07, "PosReg2Source", U16).inferred(),                                               // 2356  Position register channel 2: source
    rw(0x300B, 0x08, "PosReg1ValueA", I32).r_pdo().inferred(),                                       // 2357  Position register channel 1: comparison value A
    rw(0x300B, 0x09, "PosReg1ValueB", I32).r_pdo().inferred(),                                       // 2358  Position register channel 1: comparison value B
    rw(0x300B, 0x0A, "PosReg2ValueA", I32).r_pdo().inferred(),                                       // 2359  Position register channel 2: comparison value A
    rw(0x300B, 0x0B, "PosReg2ValueB", I32).r_pdo().inferred(),                                       // 2360  Position register channel 2: comparison value B
    rw(0x300B, 0x0C, "PosReg3Start", U16).r_pdo().inferred(),                                        // 2361  Position register channel 3: start/stop
    rw(0x300B, 0x0D, "PosReg4Start", U16).r_pdo().inferred(),                                        // 2362  Position register channel 4: start/stop
    rw(0x300B, 0x0E, "PosReg3Mode", U16).inferred(),                                                 // 2363  Position register channel 3: comparison criterion
    rw(0x300B, 0x0F, "PosReg4Mode", U16).inferred(),                                                 // 2364  Position register channel 4: comparison criterion
    rw(0x300B, 0x10, "PosReg3Source", U16).inferred(),                                               // 2365  Position register channel 3: source
    rw(0x300B, 0x11, "PosReg4Source", U16).inferred(),                                               // 2366  Position register channel 4: source
    rw(0x300B, 0x12, "PosReg3ValueA", I32).r_pdo().inferred(),                                       // 2367  Position register channel 3: comparison value A
    rw(0x300B, 0x13, "PosReg3ValueB", I32).r_pdo().inferred(),                                       // 2368  Position register channel 3: comparison value B
    rw(0x300B, 0x14, "PosReg4ValueA", I32).r_pdo().inferred(),                                       // 2369  Position register channel 4: comparison value A
    rw(0x300B, 0x15, "PosReg4ValueB", I32).r_pdo().inferred(),                                       // 2370  Position register channel 4: comparison value B
    rw(0x300B, 0x16, "PosRegGroupStart", U16).inferred(),                                            // 2371  Position register: start/stop of channels as a group
    ro(0x300D, 0x02, "_M_Type", U32).t_pdo().inferred(),                                             // 2372  Motor type
    ro(0x300D, 0x03, "_M_Encoder", U16).t_pdo().inferred(),                                          // 2373  Motor encoder type
    ro(0x300D, 0x04, "_M_n_max", U16).t_pdo().inferred(),                                            // 2374  Motor: maximum permitted speed
    ro(0x300D, 0x05, "_M_n_nom", U16).t_pdo().inferred(),                                            // 2377  Motor: nominal speed
    ro(0x300D, 0x06, "_M_I_max", U16).t_pdo().inferred(),                                            // 2378  Motor: maximum current
    ro(0x300D, 0x07, "_M_I_nom", U16).t_pdo().inferred(),                                            // 2379  Motor: nominal current
    ro(0x300D, 0x08, "_M_M_nom", U16).t_pdo().inferred(),                                            // 2380  Motor: nominal torque/force
    ro(0x300D, 0x09, "_M_M_max", U16).t_pdo().inferred(),                                            // 2381  Motor: maximum torque
    ro(0x300D, 0x0A, "_M_U_nom", U16).t_pdo().inferred(),                                            // 2382  Motor: nominal voltage
    ro(0x300D, 0x0B, "_M_kE", U32).t_pdo().inferred(),                                               // 2383  Motor: voltage constant kE
    ro(0x300D, 0x0C, "_M_Jrot", U32).t_pdo().inferred(),                                             // 2384  Motor: moment of inertia
    ro(0x300D, 0x0D, "_M_R_UV", U16).t_pdo().inferred(),                                             // 2385  Motor: winding resistance
    ro(0x300D, 0x0E, "_M_L_q", U16).t_pdo().inferred(),                                              // 2386  Motor: inductance, q component
    ro(0x300D, 0x0F, "_M_L_d", U16).t_pdo().inferred(),                                              // 2387  Motor: inductance, d component
    ro(0x300D, 0x10, "_M_T_max", I16).t_pdo().inferred(),                                            // 2388  Motor: maximum temperature
    ro(0x300D, 0x11, "_M_I2t", U16).t_pdo().inferred(),                                              // 2389  Motor: maximum permitted time at maximum current
    ro(0x300D, 0x13, "_M_I_0", U16).t_pdo().inferred(),                                              // 2390  Motor: continuous stall current
    ro(0x300D, 0x14, "_M_Polepair", U16).t_pdo().inferred(),                                         // 2391  Motor: number of pole pairs
    ro(0x300D, 0x16, "_M_M_0", U16).t_pdo().inferred(),                                              // 2392  Motor: continuous stall torque (100.0 % reference of 6071h, line 1492)
    ro(0x300D, 0x19, "_M_U_max", U16).t_pdo().inferred(),                                            // 2393  Motor: maximum voltage
    ro(0x300D, 0x20, "_M_HoldingBrake", U16).t_pdo().inferred(),                                     // 2394  Holding brake identification
    ro(0x300D, 0x21, "_M_BRK_T_apply", U16).t_pdo().inferred(),                                      // 2395  Holding brake: apply (close) time
    ro(0x300D, 0x22, "_M_BRK_T_release", U16).t_pdo().inferred(),                                    // 2396  Holding brake: release (open) time
    ro(0x300D, 0x23, "_M_PolePairPitch", U16).t_pdo().inferred(),                                    // 2397  Motor: pole pair pitch
    ro(0x3010, 0x01, "_PS_I_nom", U16).t_pdo().inferred(),                                           // 2398  Power stage nominal current
    ro(0x3010, 0x02, "_PS_I_max", U16).t_pdo().inferred(),                                           // 2399  Power stage maximum current
    ro(0x3010, 0x03, "_PS_U_maxDC", U16).t_pdo().inferred(),                                         // 2400  Maximum permitted DC bus voltage
    ro(0x3010, 0x04, "_PS_U_minDC", U16).t_pdo().inferred(),                                         // 2401  Minimum permitted DC bus voltage
    ro(0x3010, 0x06, "_PS_T_warn", I16).t_pdo().inferred(),                                          // 2402  Power stage advisory temperature limit (error class 0)
    ro(0x3010, 0x07, "_PS_T_max", I16).t_pdo().inferred(),                                           // 2403  Power stage maximum temperature
    ro(0x3010, 0x08, "_RESint_R", U16).t_pdo().inferred(),                                           // 2404  Internal braking resistor: resistance
    ro(0x3010, 0x09, "_RESint_P", U16).t_pdo().inferred(),                                           // 2405  Internal braking resistor: nominal power
    ro(0x3010, 0x0A, "_PS_U_minStopDC", U16).t_pdo().inferred(),                                     // 2406  DC bus undervoltage threshold that triggers Quick Stop
    ro(0x3011, 0x01, "_CTRL_KPid", U16).inferred(),                                                  // 2407  Current controller d: P factor
    ro(0x3011, 0x02, "_CTRL_TNid", U16).inferred(),                                                  // 2408  Current controller d: integral time
    ro(0x3011, 0x03, "_CTRL_KPiq", U16).inferred(),                                                  // 2409  Current controller q: P factor
    ro(0x3011, 0x04, "_CTRL_TNiq", U16).inferred(),                                                  // 2410  Current controller q: integral time
    rw(0x3011, 0x05, "CTRL_vPIDDTime", U16).inferred(),                                              // 2411  Velocity PID: smoothing time constant of D part
    rw(0x3011, 0x06, "CTRL_vPIDDPart", U16).inferred(),                                              // 2412  Velocity PID: D factor
    rw(0x3011, 0x08, "CTRL_TAUnact", U16).inferred(),                                                // 2413  Filter time constant for motor velocity
    rw(0x3011, 0x09, "CTRL_SpdFric", U32).inferred(),                                                // 2414  Speed up to which friction compensation is linear
    rw(0x3011, 0x0A, "CTRL_KFAcc", U16).inferred(),                                                  // 2415  Acceleration feed-forward
    rw(0x3011, 0x0C, "CTRL_I_max", U16).r_pdo().inferred(),                                          // 2416  Current limitation
    rw(0x3011, 0x0D, "LIM_I_maxQSTP", U16).inferred(),                                               // 2417  Current for Quick Stop
    rw(0x3011, 0x0E, "LIM_I_maxHalt", U16).inferred(),                                               // 2420  Current for Halt
    rw(0x3011, 0x0F, "CTRL_I_max_fw", U16).inferred(),                                               // 2421  Maximum field-weakening current (d component)
    rw(0x3011, 0x10, "CTRL_v_max", U32).assumed(13200).r_pdo().inferred(),                           // 2422  Velocity limitation (one of the two caps on 60FFh, line 1529)
    rw(0x3011, 0x14, "CTRL_ParChgTime", U16).inferred(),                                             // 2423  Transition time when switching control-loop parameter set
    rw(0x3011, 0x15, "CTRL_GlobGain", U16).inferred(),                                               // 2424  Global gain (acts on parameter set 1)
    rw(0x3011, 0x16, "CTRL_ParSetCopy", U16).inferred(),                                             // 2425  Copy control-loop parameter set
    ro(0x3011, 0x17, "_CTRL_ActParSet", U16).assumed(1).t_pdo().inferred(),                          // 2426  Active control-loop parameter set
    rw(0x3011, 0x18, "CTRL_PwrUpParSet", U16).assumed(1).inferred(),                                 // 2427  Parameter set selected at power-up
    rw(0x3011, 0x19, "CTRL_SelParSet", U16).assumed(1).inferred(),                                   // 2428  Select control-loop parameter set
    rw(0x3011, 0x1A, "CLSET_ParSwiCond", U16).inferred(),                                            // 2429  Condition for parameter set switching
    rw(0x3011, 0x1B, "CLSET_winTime", U16).inferred(),                                               // 2430  Time window for parameter set switching
    rw(0x3011, 0x1C, "CLSET_p_DiffWin", U16).inferred(),                                             // 2431  Position deviation for parameter set switching
    rw(0x3011, 0x1D, "CLSET_v_Threshol", U32).inferred(),                                            // 2432  Velocity threshold for parameter set switching
    rw(0x3011, 0x22, "CTRL_VelObsActiv", U16).inferred(),                                            // 2433  Velocity observer on/off
    rw(0x3011, 0x23, "CTRL_VelObsDyn", U16).inferred(),                                              // 2434  Velocity observer dynamics
    rw(0x3011, 0x24, "CTRL_VelObsInert", U32).inferred(),                                            // 2435  Velocity observer inertia
    rw(0x3011, 0x25, "CLSET_p_DiffWin_usr", I32).inferred(),                                         // 2436  Position deviation for parameter set switching
    rw(0x3011, 0x26, "CTRL_SmoothCurr", U16).inferred(),                                             // 2437  Current controller smoothing factor
    rw(0x3012, 0x01, "CTRL1_KPn", U16).inferred(),                                                   // 2438  Set 1 velocity controller: P factor
    rw(0x3012, 0x02, "CTRL1_TNn", U16).inferred(),                                                   // 2439  Set 1 velocity controller: integral time
    rw(0x3012, 0x03, "CTRL1_KPp", U16).inferred(),                                                   // 2440  Set 1 position controller: P factor
    rw(0x3012, 0x04, "CTRL1_TAUnref", U16).inferred(),                                               // 2441  Set 1 velocity reference filter time constant
    rw(0x3012, 0x05, "CTRL1_TAUiref", U16).inferred(),                                               // 2442  Set 1 current reference filter time constant
    rw(0x3012, 0x06, "CTRL1_KFPp", U16).assumed(0).unit("0.1 %").inferred(),                         // 2443  Set 1 velocity feed-forward
    rw(0x3012, 0x08, "CTRL1_Nf1damp", U16).inferred(),                                               // 2444  Set 1 notch filter 1: damping
    rw(0x3012, 0x09, "CTRL1_Nf1freq", U16).inferred(),                                               // 2445  Set 1 notch filter 1: frequency
    rw(0x3012, 0x0A, "CTRL1_Nf1bandw", U16).inferred(),                                              // 2446  Set 1 notch filter 1: bandwidth
    rw(0x3012, 0x0B, "CTRL1_Nf2damp", U16).inferred(),                                               // 2447  Set 1 notch filter 2: damping
    rw(0x3012, 0x0C, "CTRL1_Nf2freq", U16).inferred(),                                               // 2448  Set 1 notch filter 2: frequency
    rw(0x3012, 0x0D, "CTRL1_Nf2bandw", U16).inferred(),                                              // 2449  Set 1 notch filter 2: bandwidth
    rw(0x3012, 0x0E, "CTRL1_Osupdamp", U16).inferred(),                                              // 2450  Set 1 overshoot suppression: damping
    rw(0x3012, 0x0F, "CTRL1_Osupdelay", U16).inferred(),                                             // 2451  Set 1 overshoot suppression: time delay
    rw(0x3012, 0x10, "CTRL1_Kfric", U16).inferred(),                                                 // 2452  Set 1 friction compensation: gain
    rw(0x3013, 0x01, "CTRL2_KPn", U16).inferred(),                                                   // 2453  Set 2 velocity controller: P factor
    rw(0x3013, 0x02, "CTRL2_TNn", U16).inferred(),                                                   // 2454  Set 2 velocity controller: integral time
    rw(0x3013, 0x03, "CTRL2_KPp", U16).inferred(),                                                   // 2455  Set 2 position controller: P factor
    rw(0x3013, 0x04, "CTRL2_TAUnref", U16).inferred(),                                               // 2456  Set 2 velocity reference filter time constant
    rw(0x3013, 0x05, "CTRL2_TAUiref", U16).inferred(),                                               // 2457  Set 2 current reference filter time constant
    rw(0x3013, 0x06, "CTRL2_KFPp", U16).assumed(0).unit("0.1 %").inferred(),                         // 2458  Set 2 velocity feed-forward
    rw(0x3013, 0x08, "CTRL2_Nf1damp", U16).inferred(),                                               // 2459  Set 2 notch filter 1: damping
    rw(0x3013, 0x09, "CTRL2_Nf1freq", U16).inferred(),                                               // 2460  Set 2 notch filter 1: frequency
    rw(0x3013, 0x0A, "CTRL2_Nf1bandw", U16).inferred(),                                              // 2463  Set 2 notch filter 1: bandwidth
    rw(0x3013, 0x0B, "CTRL2_Nf2damp", U16).inferred(),                                               // 2464  Set 2 notch filter 2: damping
    rw(0x3013, 0x0C, "CTRL2_Nf2freq", U16).inferred(),                                               // 2465  Set 2 notch filter 2: frequency
    rw(0x3013, 0x0D, "CTRL2_Nf2bandw", U16).inferred(),                                              // 2466  Set 2 notch filter 2: bandwidth
    rw(0x3013, 0x0E, "CTRL2_Osupdamp", U16).inferred(),                                              // 2467  Set 2 overshoot suppression: damping
    rw(0x3013, 0x0F, "CTRL2_Osupdelay", U16).inferred(),                                             // 2468  Set 2 overshoot suppression: time delay
    rw(0x3013, 0x10, "CTRL2_Kfric", U16).inferred(),                                                 // 2469  Set 2 friction compensation: gain
    rw(0x3016, 0x03, "MBbaud", U32).inferred(),                                                      // 2470  Modbus baud rate
    rw(0x3016, 0x04, "MBaddress", U16).inferred(),                                                   // 2471  Modbus address
    rw(0x3016, 0x06, "MBnode_guard", U16).inferred(),                                                // 2472  Modbus node guarding
    ro(0x301B, 0x05, "_DPL_BitShiftRefA16", U16).t_pdo().inferred(),                                 // 2473  Drive Profile Lexium: bit shift for RefA16
    rw(0x301B, 0x06, "ErrorResp_bit_DE", I16).inferred(),                                            // 2474  Error response to a detected data error (DE bit)
    rw(0x301B, 0x07, "ErrorResp_bit_ME", I16).inferred(),                                            // 2475  Error response to a detected operating mode error (ME bit)
    rw(0x301B, 0x08, "DPL_Activate", U16).inferred(),                                                // 2476  Activate Drive Profile Lexium
    rw(0x301B, 0x09, "JOGactivate", U16).range(0, 7).default(0).r_pdo(),                             // 2477  Jog activate: bit 0 positive, bit 1 negative, bit 2 0=slow 1=fast
    rw(0x301B, 0x0A, "MSM_start_ds", U16).range(0, 127).default(0).r_pdo(),                          // 2478  Motion Sequence: data set to start
    rw(0x301B, 0x12, "GEARreference", U16).range(0, 3).default(0),                                   // 2479  Electronic Gear synchronisation method 0..3
    rw(0x301B, 0x13, "DS402compatib", U16).assumed(0).inferred(),                                    // 2480  DS402 state machine: how transition 3 -> 4 happens (values not in seed)
    rw(0x301B, 0x16, "HMp_setP", I32).inferred(),                                                    // 2481  Position-setting (dimension setting) position, for homing method 35
    ro(0x301B, 0x19, "_ModeError", U16).t_pdo().inferred(),                                          // 2482  Error code of a synchronous mode error (ME bit)
    ro(0x301B, 0x1B, "_DataError", U16).t_pdo().inferred(),                                          // 2483  Error code of a synchronous data error (DE bit)
    ro(0x301B, 0x1C, "_ModeErrorInfo", U16).t_pdo().inferred(),                                      // 2484  Additional information for ModeError
    ro(0x301B, 0x1D, "_DataErrorInfo", U16).t_pdo().inferred(),                                      // 2485  Additional information for DataError
    rw(0x301B, 0x1E, "DS402intLim", U16).inferred(),                                                 // 2486  DS402 statusword: meaning of bit 11 (internal limit), see 1335
    rw(0x301B, 0x1F, "DPL_dmControl", U16).r_pdo().inferred(),                                       // 2487  Drive Profile Lexium: dmControl
    rw(0x301B, 0x20, "DPL_RefA32", I32).r_pdo().inferred(),                                          // 2488  Drive Profile Lexium: RefA32
    rw(0x301B, 0x21, "DPL_RefB32", I32).r_pdo().inferred(),                                          // 2489  Drive Profile Lexium: RefB32
    rw(0x301B, 0x22, "DPL_RefA16", I16).r_pdo().inferred(),                                          // 2490  Drive Profile Lexium: RefA16
    ro(0x301B, 0x25, "_DPL_driveStat", U16).t_pdo().inferred(),                                      // 2491  Drive Profile Lexium: driveStat
    ro(0x301B, 0x26, "_DPL_mfStat", U16).t_pdo().inferred(),                                         // 2492  Drive Profile Lexium: mfStat
    ro(0x301B, 0x27, "_DPL_motionStat", U16).t_pdo().inferred(),                                     // 2493  Drive Profile Lexium: motionStat
    ro(0x301B, 0x28, "_DPL_driveInput", U16).t_pdo().inferred(),                                     // 2494  Drive Profile Lexium: driveInput
    rw(0x301B, 0x35, "DPL_intLim", U16).inferred(),                                                  // 2495  Meaning of bit 9 of _DPL_motionStat and _actionStatus
    rw(0x301B, 0x38, "PTtq_reference", U16).assumed(1).r_pdo().inferred(),                           // 2496  Profile Torque reference source (parameter / analog input / PTI interface, 1489-1494)
    rw(0x301B, 0x39, "PVv_reference", U16).assumed(1).r_pdo().inferred(),                            // 2497  Profile Velocity reference source (parameter / analog input, 1523-1531)
    ro(0x301C, 0x04, "_actionStatus", U16).t_pdo().inferred(),                                       // 2498  Action word
    ro(0x301C, 0x06, "_InvalidParam", U16).t_pdo().inferred(),                                       // 2499  Modbus address of the parameter that holds an invalid value
    ro(0x301C, 0x07, "_SigActive", U32).t_pdo().inferred(),                                          // 2500  State of monitoring signals
    ro(0x301C, 0x08, "_SigLatched", U32).t_pdo().inferred(),                                         // 2501  Latched state of monitoring signals
    ro(0x301C, 0x09, "_LastWarning", U16).t_pdo().inferred(),                                        // 2502  Error code of the last error of class 0
    ro(0x301C, 0x0A, "_OpHours", U32).t_pdo().inferred(),                                            // 2505  Operating hours counter
    ro(0x301C, 0x0B, "_WarnActive", U32).t_pdo().inferred(),                                         // 2506  Pending class 0 errors, bit coded (drives statusword bit 7, 1319)
    ro(0x301C, 0x0C, "_WarnLatched", U32).t_pdo().inferred(),                                        // 2507  Latched class 0 errors, bit coded
    ro(0x301C, 0x0D, "_Power_act", I32).t_pdo().inferred(),                                          // 2508  Output power
    ro(0x301C, 0x0E, "_Power_mean", U16).t_pdo().inferred(),                                         // 2509  Mean output power
    ro(0x301C, 0x0F, "_UDC_act", U16).t_pdo().inferred(),                                            // 2510  DC bus voltage
    ro(0x301C, 0x10, "_PS_T_current", I16).t_pdo().inferred(),                                       // 2511  Power stage temperature
    ro(0x301C, 0x11, "_M_T_current", I16).t_pdo().inferred(),                                        // 2512  Motor temperature
    ro(0x301C, 0x12, "_DEV_T_current", I16).t_pdo().inferred(),                                      // 2513  Device temperature
    ro(0x301C, 0x13, "_RES_overload", I16).t_pdo().inferred(),                                       // 2514  Braking resistor overload (I2t)
    ro(0x301C, 0x14, "_RES_load", I16).t_pdo().inferred(),                                           // 2515  Braking resistor load
    ro(0x301C, 0x15, "_RES_maxoverload", I16).t_pdo().inferred(),                                    // 2516  Braking resistor overload peak
    ro(0x301C, 0x16, "_PS_overload_I2t", I16).t_pdo().inferred(),                                    // 2517  Power stage overload (I2t)
    ro(0x301C, 0x17, "_PS_load", I16).t_pdo().inferred(),                                            // 2518  Power stage load
    ro(0x301C, 0x18, "_PS_maxoverload", I16).t_pdo().inferred(),                                     // 2519  Power stage overload peak
    ro(0x301C, 0x19, "_M_overload", I16).t_pdo().inferred(),                                         // 2520  Motor overload (I2t)
    ro(0x301C, 0x1A, "_M_load", I16).t_pdo().inferred(),                                             // 2521  Motor load
    ro(0x301C, 0x1B, "_M_maxoverload", I16).t_pdo().inferred(),                                      // 2522  Motor overload peak
    ro(0x301C, 0x1E, "_PT_max_val", I16).t_pdo().inferred(),                                         // 2523  Largest possible value for Profile Torque
    ro(0x301C, 0x1F, "_LastError_Qual", U16).t_pdo().inferred(),                                     // 2524  Additional information for the last detected error
    ro(0x301C, 0x22, "_PS_overload_cte", I16).t_pdo().inferred(),                                    // 2525  Power stage overload (chip temperature)
    ro(0x301C, 0x23, "_PS_overload_psq", I16).t_pdo().inferred(),                                    // 2526  Power stage overload (power squared)
    ro(0x301C, 0x24, "_PS_overload", I16).t_pdo().inferred(),                                        // 2527  Power stage overload
    ro(0x301C, 0x26, "_Cond_State4", U16).t_pdo().inferred(),                                        // 2528  Conditions for the change to Ready To Switch On
    ro(0x301C, 0x27, "_Imax_system", U16).t_pdo().inferred(),                                        // 2529  System current limit
    ro(0x301C, 0x28, "_Imax_act", U16).t_pdo().inferred(),                                           // 2530  Current limit in effect now
    ro(0x301C, 0x29, "_Vmax_act", U32).t_pdo().inferred(),                                           // 2531  Velocity limit in effect now
    ro(0x301C, 0x2B, "_M_Enc_Cosine", I16).inferred(),                                               // 2532  Encoder cosine signal voltage
    ro(0x301C, 0x2C, "_M_Enc_Sine", I16).inferred(),                                                 // 2533  Encoder sine signal voltage
    ro(0x301E, 0x01, "_Iq_act_rms", I16).t_pdo().inferred(),                                         // 2534  Actual motor current, q (torque)
    ro(0x301E, 0x02, "_Id_act_rms", I16).t_pdo().inferred(),                                         // 2535  Actual motor current, d (field weakening)
    ro(0x301E, 0x03, "_I_act", I16).t_pdo().inferred(),                                              // 2536  Total motor current
    ro(0x301E, 0x04, "_Uq_ref", I16).t_pdo().inferred(),                                             // 2537  Reference motor voltage, q
    ro(0x301E, 0x05, "_Ud_ref", I16).t_pdo().inferred(),                                             // 2538  Reference motor voltage, d
    ro(0x301E, 0x06, "_Udq_ref", I16).t_pdo().inferred(),                                            // 2539  Total motor voltage (vector sum of d and q)
    ro(0x301E, 0x07, "_n_ref", I16).t_pdo().inferred(),                                              // 2540  Reference speed
    ro(0x301E, 0x08, "_n_act", I16).t_pdo().inferred(),                                              // 2541  Actual speed
    ro(0x301E, 0x09, "_p_ref_int", I32).t_pdo().inferred(),                                          // 2542  Reference position, internal units
    ro(0x301E, 0x0C, "_p_ref", I32).t_pdo().inferred(),                                              // 2543  Reference position
    ro(0x301E, 0x0E, "_p_absmodulo", U32).t_pdo().inferred(),                                        // 2544  Absolute position relative to internal resolution, internal units
    ro(0x301E, 0x0F, "_p_absENC", U32).t_pdo().inferred(),                                           // 2547  Absolute position relative to encoder working range
    ro(0x301E, 0x10, "_lq_ref_rms", I16).t_pdo().inferred(),                                         // 2548  Reference motor current, q (torque)
    ro(0x301E, 0x11, "_ld_ref_rms", I16).t_pdo().inferred(),                                         // 2549  Reference motor current, d (field weakening)
    ro(0x301E, 0x13, "_VoltUtil", I16).t_pdo().inferred(),                                           // 2550  DC bus voltage utilisation
    ro(0x301E, 0x14, "_p_dif_usr", I32).t_pdo().inferred(),                                          // 2551  Position deviation including dynamic part
    ro(0x301E, 0x15, "_p_dif_load_peak_usr", I32).inferred(),                                        // 2552  Peak of load-dependent position deviation
    ro(0x301E, 0x16, "_p_dif_load_usr", I32).t_pdo().inferred(),                                     // 2553  Load-dependent position deviation, reference minus actual
    ro(0x301E, 0x18, "_p_DifENC1toENC2", I32).t_pdo().inferred(),                                    // 2554  Deviation between encoder positions
    ro(0x301E, 0x19, "_p_act_ENC2_int", I32).t_pdo().inferred(),                                     // 2555  Encoder 2 (module) actual position, internal units
    ro(0x301E, 0x1A, "_p_act_ENC2", I32).t_pdo().inferred(),                                         // 2556  Encoder 2 (module) actual position
    ro(0x301E, 0x1B, "_p_dif_load_peak", U32).inferred(),                                            // 2557  Peak of load-dependent position deviation
    ro(0x301E, 0x1C, "_p_dif_load", I32).t_pdo().inferred(),                                         // 2558  Load-dependent position deviation, reference versus actual
    ro(0x301E, 0x1E, "_n_act_ENC2", I16).t_pdo().inferred(),                                         // 2559  Encoder 2 (module) actual speed
    ro(0x301E, 0x1F, "_v_ref", I32).t_pdo().inferred(),                                              // 2560  Reference velocity
    ro(0x301E, 0x23, "_v_act_ENC2", I32).t_pdo().inferred(),                                         // 2561  Encoder 2 (module) actual velocity
    ro(0x301E, 0x25, "_Inc_ENC2Raw", I32).t_pdo().inferred(),                                        // 2562  Encoder 2 raw increment value
    ro(0x301E, 0x26, "_p_act_ENC1_int", I32).t_pdo().inferred(),                                     // 2563  Encoder 1 actual position, internal units
    ro(0x301E, 0x27, "_p_act_ENC1", I32).t_pdo().inferred(),                                         // 2564  Encoder 1 actual position
    ro(0x301E, 0x28, "_n_act_ENC1", I16).t_pdo().inferred(),                                         // 2565  Encoder 1 actual speed
    ro(0x301E, 0x29, "_v_act_ENC1", I32).t_pdo().inferred(),                                         // 2566  Encoder 1 actual velocity
    ro(0x301E, 0x2C, "_v_dif_usr", I32).t_pdo().inferred(),                                          // 2567  Load-dependent velocity deviation
    ro(0x301F, 0x01, "_RAMP_p_target", I32).t_pdo().inferred(),                                      // 2568  Profile generator: target position
    ro(0x301F, 0x02, "_RAMP_p_act", I32).t_pdo().inferred(),                                         // 2569  Profile generator: actual position
    ro(0x301F, 0x03, "_p_addGEAR", I32).inferred(),                                                  // 2570  Electronic gear: initial position
    ro(0x301F, 0x05, "_RAMP_v_target", I32).t_pdo().inferred(),                                      // 2571  Profile generator: target velocity
    ro(0x301F, 0x07, "_pref_v", I32).t_pdo().inferred(),                                             // 2572  Velocity of the reference used for velocity feed-forward
    ro(0x301F, 0x09, "_pref_acc", I32).t_pdo().inferred(),                                           // 2573  Acceleration of the reference used for acceleration feed-forward
    ro(0x301F, 0x0A, "_ScalePOSmax", I32).t_pdo().inferred(),                                        // 2574  Largest user value for positions
    ro(0x301F, 0x0B, "_ScaleVELmax", I32).t_pdo().inferred(),                                        // 2575  Largest user value for velocity
    ro(0x301F, 0x0C, "_ScaleRAMPmax", I32).t_pdo().inferred(),                                       // 2576  Largest user value for accelerations and decelerations
    ro(0x301F, 0x0D, "_GEAR_p_diff", I32).t_pdo().inferred(),                                        // 2577  Position deviation in Electronic Gear
    rw(0x3020, 0x04, "Iref_PTIFreqMax", U16).inferred(),                                             // 2578  Profile Torque reference current via PTI interface
    rw(0x3022, 0x04, "SyncMechTol", U16).assumed(1).inferred(),                                      // 2579  Synchronisation tolerance
    rw(0x3022, 0x05, "SyncMechStart", U16).assumed(0).inferred(),                                    // 2580  Activate synchronisation mechanism
    ro(0x3022, 0x06, "SyncMechStatus", U16).assumed(1).t_pdo().inferred(),                           // 2581  Status of synchronisation mechanism
    rw(0x3023, 0x07, "PP_ModeRangeLim", U16).inferred(),                                             // 2582  Profile Position: absolute movement beyond the movement range
    rw(0x3023, 0x09, "PP_OpmChgType", U16).inferred(),                                               // 2583  Change to Profile Position while a movement is running
    rw(0x3023, 0x0C, "RMAC_Activate", U16).inferred(),                                               // 2584  Relative Movement After Capture: activate
    rw(0x3023, 0x0D, "RMAC_Position", I32).inferred(),                                               // 2585  Relative Movement After Capture: target position
    rw(0x3023, 0x0E, "RMAC_Velocity", U32).inferred(),                                               // 2586  Relative Movement After Capture: velocity
    rw(0x3023, 0x0F, "RMAC_Response", U16).inferred(),                                               // 2589  Relative Movement After Capture: response if target already passed
    rw(0x3023, 0x10, "RMAC_Edge", U16).inferred(),                                                   // 2590  Relative Movement After Capture: capture edge
    ro(0x3023, 0x11, "_RMAC_Status", U16).t_pdo().inferred(),                                        // 2591  Relative Movement After Capture: status
    ro(0x3023, 0x12, "_RMAC_DetailStatus", U16).t_pdo().inferred(),                                  // 2592  Relative Movement After Capture: detailed status
    rw(0x3026, 0x03, "GEARdenom", I32).assumed(1).r_pdo().inferred(),                                // 2593  Gear ratio denominator
    rw(0x3026, 0x04, "GEARnum", I32).assumed(1).r_pdo().inferred(),                                  // 2594  Gear ratio numerator
    rw(0x3026, 0x05, "GEARdir_enabl", U16).assumed(3).inferred(),                                    // 2595  Electronic Gear: permitted direction of movement
    rw(0x3026, 0x06, "GEARratio", U16).inferred(),                                                   // 2596  Gear ratio selection
    rw(0x3026, 0x07, "GEARjerklim", U16).inferred(),                                                 // 2597  Electronic Gear: jerk limit on/off
    rw(0x3026, 0x09, "GEARpos_v_max", U32).inferred(),                                               // 2598  Velocity limit for position synchronisation method
    rw(0x3026, 0x0B, "GEARposChgMode", U16).inferred(),                                              // 2599  Treatment of position changes while power stage is off
    rw(0x3026, 0x0C, "GEARdenom2", I32).assumed(1).inferred(),                                       // 2600  Gear ratio number 2: denominator
    rw(0x3026, 0x0D, "GEARnum2", I32).assumed(1).inferred(),                                         // 2601  Gear ratio number 2: numerator
    rw(0x3026, 0x0E, "GEARselect", U16).inferred(),                                                  // 2602  Select gear ratio
    rw(0x3027, 0x01, "OFSp_abs", I32).inferred(),                                                    // 2603  Offset movement: start, absolute
    rw(0x3027, 0x03, "OFSp_rel", I32).inferred(),                                                    // 2604  Offset movement: start, relative
    rw(0x3027, 0x04, "OFSv_target", U32).inferred(),                                                 // 2605  Offset movement: target velocity
    rw(0x3027, 0x05, "OFSp_SetPos", I32).inferred(),                                                 // 2606  Offset movement: set offset position
    rw(0x3027, 0x06, "OFS_Ramp", U32).inferred(),                                                    // 2607  Offset movement: acceleration and deceleration
    rw(0x3027, 0x08, "OFSp_RelPos1", I32).inferred(),                                                // 2608  Offset movement: relative offset position 1
    rw(0x3027, 0x0A, "OFSp_RelPos2", I32).inferred(),                                                // 2609  Offset movement: relative offset position 2
    rw(0x3027, 0x0B, "OFS_PosActivate", U16).inferred(),                                             // 2610  Offset movement with relative offset position
    ro(0x3027, 0x0C, "_OFSp_act", I32).inferred(),                                                   // 2611  Offset movement: actual position
    rw(0x3028, 0x06, "HMoutdis", I32).assumed(0).inferred(),                                         // 2612  Homing: maximum distance when searching for switching point
    rw(0x3028, 0x07, "HMdis", I32).assumed(200).inferred(),                                          // 2613  Homing: distance from switching point
    rw(0x3028, 0x0A, "HMprefmethod", I16).assumed(18).inferred(),                                    // 2614  Homing: preferred method
    rw(0x3028, 0x0B, "HMp_home", I32).r_pdo().inferred(),                                            // 2615  Homing: position at reference point
    ro(0x3028, 0x0C, "_HMdisREFtoIDX", I32).t_pdo().inferred(),                                      // 2616  Homing: distance switching point to index pulse
    rw(0x3028, 0x0D, "HMsrchdis", I32).inferred(),                                                   // 2617  Homing: maximum search distance after overrunning the switch
    ro(0x3028, 0x0F, "_HMdisREFtoIDX_usr", I32).t_pdo().inferred(),                                  // 2618  Homing: distance switching point to index pulse
    rw(0x3029, 0x03, "JOGmethod", U16).r_pdo().inferred(),                                           // 2619  Jog: method selection
    rw(0x3029, 0x04, "JOGv_slow", U32).assumed(60).r_pdo().inferred(),                               // 2620  Jog: slow velocity
    rw(0x3029, 0x05, "JOGv_fast", U32).assumed(180).r_pdo().inferred(),                              // 2621  Jog: fast velocity
    rw(0x3029, 0x07, "JOGstep", I32).assumed(20).inferred(),                                         // 2622  Jog: step distance
    rw(0x3029, 0x08, "JOGtime", U16).assumed(500).inferred(),                                        // 2623  Jog: wait time for step movement
    ro(0x302D, 0x06, "_MSMactNum", I16).t_pdo().inferred(),                                          // 2624  Motion Sequence: number of data set being processed
    ro(0x302D, 0x07, "_MSMnextNum", I16).t_pdo().inferred(),                                         // 2625  Motion Sequence: data set to be executed next
    rw(0x302D, 0x08, "MSM_CondSequ", U16).inferred(),                                                // 2626  Motion Sequence: start condition for starting a sequence via signal input
    rw(0x302D, 0x09, "MSMendNumSequence", U16).inferred(),                                           // 2627  Motion Sequence: data set number adopted after end of sequence
    ro(0x302D, 0x0B, "_MSMNumFinish", I16).t_pdo().inferred(),                                       // 2628  Motion Sequence: active data set number when movement was aborted
    rw(0x302D, 0x0C, "MSMstartSignal", U16).inferred(),                                              // 2631  Motion Sequence: response to falling edge at Start Signal Data Set input
    ro(0x302D, 0x0D, "_MSM_error_num", I16).t_pdo().inferred(),                                      // 2632  Motion Sequence: data set in which an error was found
    ro(0x302D, 0x0E, "_MSM_error_field", I16).t_pdo().inferred(),                                    // 2633  Motion Sequence: field of that data set in which the error was found
    ro(0x302D, 0x0F, "_MSM_avail_ds", U16).assumed(128).t_pdo().inferred(),                          // 2634  Motion Sequence: number of available data sets
    rw(0x302D, 0x10, "MSM_datasetnum", U16).inferred(),                                              // 2635  Data set table: data set number selector
    rw(0x302D, 0x11, "MSM_ds_type", U16).inferred(),                                                 // 2636  Data set table: type
    rw(0x302D, 0x12, "MSM_ds_setA", I32).inferred(),                                                 // 2637  Data set table: setting A
    rw(0x302D, 0x13, "MSM_ds_setB", I32).inferred(),                                                 // 2638  Data set table: setting B
    rw(0x302D, 0x14, "MSM_ds_setC", I32).inferred(),                                                 // 2639  Data set table: setting C
    rw(0x302D, 0x15, "MSM_ds_setD", I32).inferred(),                                                 // 2640  Data set table: setting D
    rw(0x302D, 0x16, "MSM_ds_transiti", U16).inferred(),                                             // 2641  Data set table: transition type
    rw(0x302D, 0x17, "MSM_ds_sub_ds", U16).inferred(),                                               // 2642  Data set table: subsequent data set
    rw(0x302D, 0x18, "MSM_ds_trancon1", U16).inferred(),                                             // 2643  Data set table: transition condition 1
    rw(0x302D, 0x19, "MSM_ds_tranval1", I32).inferred(),                                             // 2644  Data set table: value for transition condition 1
    rw(0x302D, 0x1A, "MSM_ds_logopera", U16).inferred(),                                             // 2645  Data set table: logical operator
    rw(0x302D, 0x1C, "MSM_ds_trancon2", U16).inferred(),                                             // 2646  Data set table: transition condition 2
    rw(0x302D, 0x1D, "MSM_ds_tranval2", I32).inferred(),                                             // 2647  Data set table: value for transition condition 2
    ro(0x302D, 0x1F, "_MSM_used_data_sets", U16).t_pdo().inferred(),                                 // 2648  Motion Sequence: number of data sets in use
    rw(0x302D, 0x20, "MSM_DebDigInNum", U16).inferred(),                                             // 2649  Debounce time for data set selection inputs
    rw(0x302D, 0x21, "MSM_AddtlSettings", U16).inferred(),                                           // 2650  Motion Sequence: additional settings
    rw(0x302E, 0x03, "MT_dismax", U16).inferred(),                                                   // 2651  Manual tuning: maximum permitted distance
    rw(0x302E, 0x0A, "MT_dismax_usr", I32).inferred(),                                               // 2652  Manual tuning: maximum permitted distance
    rw(0x302F, 0x01, "AT_start", U16).inferred(),                                                    // 2653  Autotuning: start
    ro(0x302F, 0x02, "_AT_state", U16).t_pdo().inferred(),                                           // 2654  Autotuning: state
    rw(0x302F, 0x03, "AT_dis", U32).inferred(),                                                      // 2655  Autotuning: movement range
    rw(0x302F, 0x04, "AT_dir", U16).inferred(),                                                      // 2656  Autotuning: direction
    rw(0x302F, 0x06, "AT_n_ref", U32).inferred(),                                                    // 2657  Autotuning: velocity step
    ro(0x302F, 0x07, "_AT_M_friction", U16).t_pdo().inferred(),                                      // 2658  Autotuning: friction torque
    ro(0x302F, 0x08, "_AT_M_load", I16).t_pdo().inferred(),                                          // 2659  Autotuning: constant load torque
    rw(0x302F, 0x09, "AT_wait", U16).inferred(),                                                     // 2660  Autotuning: wait time between steps
    ro(0x302F, 0x0B, "_AT_progress", U16).t_pdo().inferred(),                                        // 2661  Autotuning: progress
    ro(0x302F, 0x0C, "_AT_J", U16).t_pdo().inferred(),                                               // 2662  Autotuning: moment of inertia of system
    rw(0x302F, 0x0E, "AT_mechanical", U16).inferred(),                                               // 2663  Autotuning: type of coupling
    rw(0x302F, 0x12, "AT_dis_usr", I32).inferred(),                                                  // 2664  Autotuning: movement range
    rw(0x302F, 0x13, "AT_v_ref", I32).inferred(),                                                    // 2665  Autotuning: velocity step
    rw(0x303A, 0x01, "HMIlocked", U16).inferred(),                                                   // 2666  Lock HMI
    rw(0x303A, 0x02, "HMIDispPara", U16).inferred(),                                                 // 2667  HMI display while motor moves
    ro(0x303B, 0x02, "_ERR_powerOn", U32).assumed(1).t_pdo().inferred(),                             // 2668  Number of power-on cycles
    rw(0x303B, 0x04, "ERR_clear", U16).inferred(),                                                   // 2669  Clear error memory
    rw(0x303B, 0x05, "ERR_reset", U16).inferred(),                                                   // 2670  Reset read pointer of error memory
    rw(0x303B, 0x06, "MON_IO_SelErr1", U16).inferred(),                                              // 2673  Signal output function Selected Error (classes 1..4): first error code
    rw(0x303B, 0x07, "MON_IO_SelErr2", U16).inferred(),                                              // 2674  Signal output function Selected Error (classes 1..4): second error code
    rw(0x303B, 0x08, "MON_IO_SelWar1", U16).inferred(),                                              // 2675  Signal output function Selected Warning (class 0): first error code
    rw(0x303B, 0x09, "MON_IO_SelWar2", U16).inferred(),                                              // 2676  Signal output function Selected Warning (class 0): second error code
    ro(0x303C, 0x01, "_ERR_number", U16).inferred(),                                                 // 2677  Error memory entry: error code
    ro(0x303C, 0x02, "_ERR_class", U16).inferred(),                                                  // 2678  Error memory entry: error class
    ro(0x303C, 0x03, "_ERR_time", U32).inferred(),                                                   // 2679  Error memory entry: time of detection
    ro(0x303C, 0x04, "_ERR_qual", U16).inferred(),                                                   // 2680  Error memory entry: additional information
    ro(0x303C, 0x05, "_ERR_enable_cycl", U16).inferred(),                                            // 2681  Error memory entry: number of enable cycles at that time
    ro(0x303C, 0x06, "_ERR_enable_time", U16).inferred(),                                            // 2682  Error memory entry: time from enable to detection
    ro(0x303C, 0x07, "_ERR_DCbus", U16).inferred(),                                                  // 2683  Error memory entry: DC bus voltage
    ro(0x303C, 0x08, "_ERR_motor_v", I32).inferred(),                                                // 2684  Error memory entry: motor velocity
    ro(0x303C, 0x09, "_ERR_motor_I", U16).inferred(),                                                // 2685  Error memory entry: motor current
    ro(0x303C, 0x0A, "_ERR_temp_ps", I16).inferred(),                                                // 2686  Error memory entry: power stage temperature
    ro(0x303C, 0x0B, "_ERR_temp_dev", I16).inferred(),                                               // 2687  Error memory entry: device temperature
    ro(0x303E, 0x04, "_IPAddressAct1", U16).inferred(),                                              // 2688  IP address in use, byte 1
    ro(0x303E, 0x05, "_IPAddressAct2", U16).inferred(),                                              // 2689  IP address in use, byte 2
    ro(0x303E, 0x06, "_IPAddressAct3", U16).inferred(),                                              // 2690  IP address in use, byte 3
    ro(0x303E, 0x07, "_IPAddressAct4", U16).inferred(),                                              // 2691  IP address in use, byte 4
    ro(0x303E, 0x08, "_IPmaskAct1", U16).inferred(),                                                 // 2692  IP subnet mask in use, byte 1
    ro(0x303E, 0x09, "_IPmaskAct2", U16).inferred(),                                                 // 2693  IP subnet mask in use, byte 2
    ro(0x303E, 0x0A, "_IPmaskAct3", U16).inferred(),                                                 // 2694  IP subnet mask in use, byte 3
    ro(0x303E, 0x0B, "_IPmaskAct4", U16).inferred(),                                                 // 2695  IP subnet mask in use, byte 4
    ro(0x303E, 0x0C, "_IPgateAct1", U16).inferred(),                                                 // 2696  IP gateway in use, byte 1
    ro(0x303E, 0x0D, "_IPgateAct2", U16).inferred(),                                                 // 2697  IP gateway in use, byte 2
    ro(0x303E, 0x0E, "_IPgateAct3", U16).inferred(),                                                 // 2698  IP gateway in use, byte 3
    ro(0x303E, 0x0F, "_IPgateAct4", U16).inferred(),                                                 // 2699  IP gateway in use, byte 4
    rw(0x303E, 0x11, "DevNameExtAddr", U16).inferred(),                                              // 2700  Value for the device name extension
    ro(0x303F, 0x5D, "_ENC_AmplVal", U16).inferred(),                                                // 2701  SinCos amplitude value
    ro(0x303F, 0x5E, "_ENC_AmplMean", U16).inferred(),                                               // 2702  SinCos amplitude mean
    ro(0x303F, 0x5F, "_ENC_AmplMin", U16).inferred(),                                                // 2703  SinCos amplitude minimum
    ro(0x303F, 0x60, "_ENC_AmplMax", U16).inferred(),                                                // 2704  SinCos amplitude maximum
    rw(0x303F, 0x61, "MON_ENC_Ampl", U16).inferred(),                                                // 2705  SinCos amplitude monitoring on/off
    ro(0x303F, 0x62, "_CommutCntAct", I16).inferred(),                                               // 2706  Commutation monitoring counter, actual
    rw(0x303F, 0x63, "CommutCntMax", I16).inferred(),                                                // 2707  Commutation monitoring counter, maximum reached
    rw(0x303F, 0x68, "MON_MotOvLoadOvTemp", U16).inferred(),                                         // 2708  Motor overload and overtemperature monitoring
    ro(0x3040, 0x01, "_IOdataMtoS01", U32).inferred(),                                               // 2709  I/O parameter data master-to-slave, parameter 01
    ro(0x3040, 0x11, "_IOMappingMtoS01", U16).inferred(),                                            // 2710  I/O parameter mapping master-to-slave, parameter 01
    ro(0x3040, 0x21, "_IOdataStoM01", U32).inferred(),                                               // 2711  I/O parameter data slave-to-master, parameter 01
    ro(0x3040, 0x31, "_IOmappingStoM01", U16).inferred(),                                            // 2714  I/O parameter mapping slave-to-master, parameter 01
    rw(0x3040, 0x42, "PDOmask", U16).inferred(),                                                     // 2715  Deactivate receive PDO (values not in seed)
    ro(0x3040, 0x43, "_ErrNumFbParSvc", U16).inferred(),                                             // 2716  Last error code of the fieldbus parameter services
    ro(0x3041, 0x06, "_CanDiag", U16).inferred(),                                                    // 2717  CANopen diagnostic word (coding not in seed)
    ro(0x3041, 0x0A, "_ManuSdoAbort", U16),                                                          // 2718  Vendor detail for SDO abort 0800 0000
    rw(0x3041, 0x0B, "CANpdo1Event", U16).range(0, 15).default(1),                                   // 2719  PDO 1 event mask, bits 0..3
    rw(0x3041, 0x0C, "CANpdo2Event", U16).range(0, 15).default(1),                                   // 2720  PDO 2 event mask, bits 0..3
    rw(0x3041, 0x0D, "CANpdo3Event", U16).range(0, 15).default(1),                                   // 2721  PDO 3 event mask, bits 0..3
    rw(0x3041, 0x0E, "CANpdo4Event", U16).range(0, 15).default(15),                                  // 2722  PDO 4 event mask, bits 0..3
    rw(0x3041, 0x11, "ErrResp_HeartB_LifeG", U16).assumed(2).inferred(),                             // 2723  CANopen error response on a detected heartbeat or life guarding error (values not in seed)
    rw(0x3042, 0x01, "DVNaddress", U16).inferred(),                                                  // 2724  DeviceNet node address (MAC ID)
    rw(0x3042, 0x02, "DVNbaud", U16).inferred(),                                                     // 2725  DeviceNet baud rate
    rw(0x3042, 0x03, "DVNbuspower", U16).inferred(),                                                 // 2726  DeviceNet bus supply monitoring
    rw(0x3042, 0x04, "DVNioDataIn", U16).inferred(),                                                 // 2727  DeviceNet I/O data input
    rw(0x3042, 0x05, "DVNioDataOut", U16).inferred(),                                                // 2728  DeviceNet I/O data output
    rw(0x3043, 0x02, "PBaddress", U16).inferred(),                                                   // 2729  Profibus address
    ro(0x3043, 0x03, "_PBprofile", U16).inferred(),                                                  // 2730  Profibus drive profile
    ro(0x3043, 0x04, "_PBbaud", U16).inferred(),                                                     // 2731  Profibus baud rate
    rw(0x3044, 0x01, "EthMode", U16).inferred(),                                                     // 2732  Ethernet protocol
    rw(0x3044, 0x02, "EthRateSet", U16).inferred(),                                                  // 2733  Ethernet transmission rate setting
    rw(0x3044, 0x05, "EthIpMode", U16).inferred(),                                                   // 2734  Ethernet: how the IP address is obtained
    rw(0x3044, 0x07, "EthIPmodule1", U16).inferred(),                                                // 2735  Ethernet module IP address, byte 1
    rw(0x3044, 0x08, "EthIPmodule2", U16).inferred(),                                                // 2736  Ethernet module IP address, byte 2
    rw(0x3044, 0x09, "EthIPmodule3", U16).inferred(),                                                // 2737  Ethernet module IP address, byte 3
    rw(0x3044, 0x0A, "EthIPmodule4", U16).inferred(),                                                // 2738  Ethernet module IP address, byte 4
    rw(0x3044, 0x0B, "EthIPmask1", U16).inferred(),                                                  // 2739  Ethernet subnet mask, byte 1
    rw(0x3044, 0x0C, "EthIPmask2", U16).inferred(),                                                  // 2740  Ethernet subnet mask, byte 2
    rw(0x3044, 0x0D, "EthIPmask3", U16).inferred(),                                                  // 2741  Ethernet subnet mask, byte 3
    rw(0x3044, 0x0E, "EthIPmask4", U16).inferred(),                                                  // 2742  Ethernet subnet mask, byte 4
    rw(0x3044, 0x0F, "EthIPgate1", U16).inferred(),                                                  // 2743  Ethernet gateway, byte 1
    rw(0x3044, 0x10, "EthIPgate2", U16).inferred(),                                                  // 2744  Ethernet gateway, byte 2
    rw(0x3044, 0x11, "EthIPgate3", U16).inferred(),                                                  // 2745  Ethernet gateway, byte 3
    rw(0x3044, 0x12, "EthIPgate4", U16).inferred(),                                                  // 2746  Ethernet gateway, byte 4
    ro(0x3044, 0x13, "_EthIPmoduleAct1", U16).inferred(),                                            // 2747  Ethernet module IP address in use, byte 1
    ro(0x3044, 0x14, "_EthIPmoduleAct2", U16).inferred(),                                            // 2748  Ethernet module IP address in use, byte 2
    ro(0x3044, 0x15, "_EthIPmoduleAct3", U16).inferred(),                                            // 2749  Ethernet module IP address in use, byte 3
    ro(0x3044, 0x16, "_EthIPmoduleAct4", U16).inferred(),                                            // 2750  Ethernet module IP address in use, byte 4
    ro(0x3044, 0x17, "_EthIPmaskAct1", U16).inferred(),                                              // 2751  Ethernet subnet mask in use, byte 1
    ro(0x3044, 0x18, "_EthIPmaskAct2", U16).inferred(),                                              // 2752  Ethernet subnet mask in use, byte 2
    ro(0x3044, 0x19, "_EthIPmaskAct3", U16).inferred(),                                              // 2753  Ethernet subnet mask in use, byte 3
    ro(0x3044, 0x1A, "_EthIPmaskAct4", U16).inferred(),                                              // 2754  Ethernet subnet mask in use, byte 4
    ro(0x3044, 0x1B, "_EthIPgateAct1", U16).inferred(),                                              // 2757  Ethernet gateway in use, byte 1
    ro(0x3044, 0x1C, "_EthIPgateAct2", U16).inferred(),                                              // 2758  Ethernet gateway in use, byte 2
    ro(0x3044, 0x1D, "_EthIPgateAct3", U16).inferred(),                                              // 2759  Ethernet gateway in use, byte 3
    ro(0x3044, 0x1E, "_EthIPgateAct4", U16).inferred(),                                              // 2760  Ethernet gateway in use, byte 4
    ro(0x3044, 0x1F, "_EthMAC1", U16).inferred(),                                                    // 2761  Ethernet module MAC address, byte 1
    ro(0x3044, 0x20, "_EthMAC2", U16).inferred(),                                                    // 2762  Ethernet module MAC address, byte 2
    ro(0x3044, 0x21, "_EthMAC3", U16).inferred(),                                                    // 2763  Ethernet module MAC address, byte 3
    ro(0x3044, 0x22, "_EthMAC4", U16).inferred(),                                                    // 2764  Ethernet module MAC address, byte 4
    ro(0x3044, 0x23, "_EthMAC5", U16).inferred(),                                                    // 2765  Ethernet module MAC address, byte 5
    ro(0x3044, 0x24, "_EthMAC6", U16).inferred(),                                                    // 2766  Ethernet module MAC address, byte 6
    rw(0x3044, 0x28, "EthMbScanner", U16).inferred(),                                                // 2767  Modbus TCP I/O scanning
    rw(0x3044, 0x29, "EthIPmaster1", U16).inferred(),                                                // 2768  Master IP address, byte 1
    rw(0x3044, 0x2A, "EthIPmaster2", U16).inferred(),                                                // 2769  Master IP address, byte 2
    rw(0x3044, 0x2B, "EthIPmaster3", U16).inferred(),                                                // 2770  Master IP address, byte 3
    rw(0x3044, 0x2C, "EthIPmaster4", U16).inferred(),                                                // 2771  Master IP address, byte 4
    rw(0x3044, 0x2D, "EthMbScanTimeout", U16).inferred(),                                            // 2772  Modbus TCP I/O scanning timeout
    rw(0x3044, 0x2E, "EthOptMapOut1", U16).inferred(),                                               // 2773  Optional mapped output parameter 1 (controller to drive)
    rw(0x3044, 0x2F, "EthOptMapOut2", U16).inferred(),                                               // 2774  Optional mapped output parameter 2 (controller to drive)
    rw(0x3044, 0x30, "EthOptMapOut3", U16).inferred(),                                               // 2775  Optional mapped output parameter 3 (controller to drive)
    rw(0x3044, 0x34, "EthOptMapInp1", U16).inferred(),                                               // 2776  Optional mapped parameter 1 (drive to controller)
    rw(0x3044, 0x35, "EthOptMapInp2", U16).inferred(),                                               // 2777  Optional mapped parameter 2 (drive to controller)
    rw(0x3044, 0x36, "EthOptMapInp3", U16).inferred(),                                               // 2778  Optional mapped parameter 3 (drive to controller)
    rw(0x3044, 0x50, "EthMbIPswap1", U16).inferred(),                                                // 2779  Master IP address for Modbus word swap, byte 1
    rw(0x3044, 0x51, "EthMbIPswap2", U16).inferred(),                                                // 2780  Master IP address for Modbus word swap, byte 2
    rw(0x3044, 0x52, "EthMbIPswap3", U16).inferred(),                                                // 2781  Master IP address for Modbus word swap, byte 3
    rw(0x3044, 0x53, "EthMbIPswap4", U16).inferred(),                                                // 2782  Master IP address for Modbus word swap, byte 4
    ro(0x3045, 0x02, "_ECATslavestate", U16).inferred(),                                             // 2783  EtherCAT slave state
    rw(0x3045, 0x06, "ECAT2ndaddress", U16).inferred(),                                              // 2784  Value for an EtherCAT identification
    ro(0x3045, 0x07, "_ECATaddress", U16).inferred(),                                                // 2785  EtherCAT address in use
    rw(0x3048, 0x02, "PntIPMode", U16).inferred(),                                                   // 2786  PROFINET: how the IP address is obtained
    ro(0x3048, 0x03, "_PntProfile", U16).inferred(),                                                 // 2787  PROFINET drive profile
    rw(0x3048, 0x07, "PntIPAddress1", U16).inferred(),                                               // 2788  PROFINET IP address, byte 1
    rw(0x3048, 0x08, "PntIPAddress2", U16).inferred(),                                               // 2789  PROFINET IP address, byte 2
    rw(0x3048, 0x09, "PntIPAddress3", U16).inferred(),                                               // 2790  PROFINET IP address, byte 3
    rw(0x3048, 0x0A, "PntIPAddress4", U16).inferred(),                                               // 2791  PROFINET IP address, byte 4
    rw(0x3048, 0x0B, "PntIPmask1", U16).inferred(),                                                  // 2792  PROFINET subnet mask, byte 1
    rw(0x3048, 0x0C, "PntIPmask2", U16).inferred(),                                                  // 2793  PROFINET subnet mask, byte 2
    rw(0x3048, 0x0D, "PntIPmask3", U16).inferred(),                                                  // 2794  PROFINET subnet mask, byte 3
    rw(0x3048, 0x0E, "PntIPmask4", U16).inferred(),                                                  // 2797  PROFINET subnet mask, byte 4
    rw(0x3048, 0x0F, "PntIPgate1", U16).inferred(),                                                  // 2798  PROFINET gateway, byte 1
    rw(0x3048, 0x10, "PntIPgate2", U16).inferred(),                                                  // 2799  PROFINET gateway, byte 2
    rw(0x3048, 0x11, "PntIPgate3", U16).inferred(),                                                  // 2800  PROFINET gateway, byte 3
    rw(0x3048, 0x12, "PntIPgate4", U16).inferred(),                                                  // 2801  PROFINET gateway, byte 4
    ro(0x3048, 0x25, "_PntMAC1", U16).inferred(),                                                    // 2802  PROFINET module MAC address, byte 1
    ro(0x3048, 0x26, "_PntMAC2", U16).inferred(),                                                    // 2803  PROFINET module MAC address, byte 2
    ro(0x3048, 0x27, "_PntMAC3", U16).inferred(),                                                    // 2804  PROFINET module MAC address, byte 3
    ro(0x3048, 0x28, "_PntMAC4", U16).inferred(),                                                    // 2805  PROFINET module MAC address, byte 4
    ro(0x3048, 0x29, "_PntMAC5", U16).inferred(),                                                    // 2806  PROFINET module MAC address, byte 5
    ro(0x3048, 0x2A, "_PntMAC6", U16).inferred(),                                                    // 2807  PROFINET module MAC address, byte 6
    ro(0x304C, 0x0F, "_eSMVer", U32).inferred(),                                                     // 2808  eSM firmware revision
    ro(0x304C, 0x12, "_eSM_LI_act", U16).t_pdo().inferred(),                                         // 2809  eSM digital inputs, channel B
    ro(0x304C, 0x13, "_eSM_LI_mask", U16).inferred(),                                                // 2810  eSM digital inputs, channel B mask
    ro(0x304C, 0x14, "_eSM_LO_act", U16).t_pdo().inferred(),                                         // 2811  eSM digital outputs, channel B
    rw(0x304C, 0x15, "eSM_LO_mask", U16).inferred(),                                                 // 2812  eSM digital outputs, channel B mask
    ro(0x304C, 0x16, "_eSM_state", U16).t_pdo().inferred(),                                          // 2813  eSM operating state
    ro(0x304C, 0x17, "_eSM_funcnt", U16).t_pdo().inferred(),                                         // 2814  eSM function
    rw(0x304C, 0x1A, "eSM_disable", U16).inferred(),                                                 // 2815  eSM deactivation
    ro(0x304F, 0x01, "_IOM1_AI11_act", I16).t_pdo().inferred(),                                      // 2816  IOM1 AI11: input voltage
    rw(0x304F, 0x02, "IOM1_AI11_Tau", U16).inferred(),                                               // 2817  IOM1 AI11: filter time constant
    ro(0x304F, 0x05, "_IOM1_AI12_act", I16).t_pdo().inferred(),                                      // 2818  IOM1 AI12: input voltage
    rw(0x304F, 0x09, "IOM1_AI11_win", U16).inferred(),                                               // 2819  IOM1 AI11: zero voltage window
    rw(0x304F, 0x0A, "IOM1_AI12_win", U16).inferred(),                                               // 2820  IOM1 AI12: zero voltage window
    rw(0x304F, 0x0B, "IOM1_AI11_offset", I16).inferred(),                                            // 2821  IOM1 AI11: offset voltage
    rw(0x304F, 0x0C, "IOM1_AI12_offset", I16).inferred(),                                            // 2822  IOM1 AI12: offset voltage
    rw(0x304F, 0x0E, "IOM1_AI11_mode", U16).inferred(),                                              // 2823  IOM1 AI11: type of usage
    rw(0x304F, 0x0F, "IOM1_AI11_I_max", U16).inferred(),                                             // 2824  IOM1 AI11: current limit at 10 V
    rw(0x304F, 0x10, "IOM1_AI11_v_max", U32).inferred(),                                             // 2825  IOM1 AI11: velocity limit at 10 V
    rw(0x304F, 0x11, "IOM1_AI11_v_scale", I32).inferred(),                                           // 2826  IOM1 AI11: Profile Velocity target at 10 V
    rw(0x304F, 0x12, "IOM1_AI11_M_scale", I16).inferred(),                                           // 2827  IOM1 AI11: Profile Torque target at 10 V
    rw(0x304F, 0x13, "IOM1_AI12_mode", U16).inferred(),                                              // 2828  IOM1 AI12: type of usage
    rw(0x304F, 0x14, "IOM1_AI12_I_max", U16).inferred(),                                             // 2829  IOM1 AI12: current limit at 10 V
    rw(0x304F, 0x15, "IOM1_AI12_v_max", U32).inferred(),                                             // 2830  IOM1 AI12: velocity limit at 10 V
    rw(0x304F, 0x16, "IOM1_AI12_v_scale", I32).inferred(),                                           // 2831  IOM1 AI12: Profile Velocity target at 10 V
    rw(0x304F, 0x17, "IOM1_AI12_M_scale", I16).inferred(),                                           // 2832  IOM1 AI12: Profile Torque target at 10 V
    rw(0x304F, 0x18, "IOM1_AI12_Tau", U16).inferred(),                                               // 2833  IOM1 AI12: filter time constant
    rw(0x304F, 0x1F, "IOM1_AQ_ErrResp", U16).inferred(),                                             // 2834  IOM1 error response to overload of analog outputs
    rw(0x304F, 0x20, "IOM1_AQ_mode", U16).inferred(),                                                // 2835  IOM1 analog outputs: type of usage
    rw(0x304F, 0x21, "IOM1_AQ11_func", U16).inferred(),                                              // 2836  IOM1 AQ11: function
    rw(0x304F, 0x22, "IOM1_AQ11_I_range", U16).inferred(),                                           // 2837  IOM1 AQ11: current range
    rw(0x304F, 0x23, "IOM1_AQ11_invert", U16).inferred(),                                            // 2840  IOM1 AQ11: inversion
    rw(0x304F, 0x24, "IOM1_AQ11_FixVal", I16).r_pdo().inferred(),                                    // 2841  IOM1 AQ11: fixed value
    ro(0x304F, 0x27, "_IOM1_AQ11_ref", I16).t_pdo().inferred(),                                      // 2842  IOM1 AQ11: value
    rw(0x304F, 0x2B, "IOM1_AQ12_func", U16).inferred(),                                              // 2843  IOM1 AQ12: function
    rw(0x304F, 0x2C, "IOM1_AQ12_I_range", U16).inferred(),                                           // 2844  IOM1 AQ12: current range
    rw(0x304F, 0x2D, "IOM1_AQ12_invert", U16).inferred(),                                            // 2845  IOM1 AQ12: inversion
    rw(0x304F, 0x2E, "IOM1_AQ12_FixVal", I16).r_pdo().inferred(),                                    // 2846  IOM1 AQ12: fixed value
    ro(0x304F, 0x31, "_IOM1_AQ12_ref", I16).t_pdo().inferred(),                                      // 2847  IOM1 AQ12: value
    ro(0x304F, 0x35, "_IOM1_DI_act", U16).t_pdo().inferred(),                                        // 2848  IOM1 digital inputs: state
    ro(0x304F, 0x36, "_IOM1_DQ_act", U16).t_pdo().inferred(),                                        // 2849  IOM1 digital outputs: state
    rw(0x304F, 0x37, "IOM1_DQ_set", U16).r_pdo().inferred(),                                         // 2850  IOM1 digital outputs: set directly
    rw(0x304F, 0x40, "IOM1_DI_10_Deb", U16).inferred(),                                              // 2851  IOM1 DI10: debounce time
    rw(0x304F, 0x41, "IOM1_DI_11_Deb", U16).inferred(),                                              // 2852  IOM1 DI11: debounce time
    rw(0x304F, 0x42, "IOM1_DI_12_Deb", U16).inferred(),                                              // 2853  IOM1 DI12: debounce time
    rw(0x304F, 0x43, "IOM1_DI_13_Deb", U16).inferred(),                                              // 2854  IOM1 DI13: debounce time
    rw(0x304F, 0x50, "IOM1_IOfunct_DI10", U16).inferred(),                                           // 2855  IOM1 DI10: function
    rw(0x304F, 0x51, "IOM1_IOfunct_DI11", U16).inferred(),                                           // 2856  IOM1 DI11: function
    rw(0x304F, 0x52, "IOM1_IOfunct_DI12", U16).inferred(),                                           // 2857  IOM1 DI12: function
    rw(0x304F, 0x53, "IOM1_IOfunct_DI13", U16).inferred(),                                           // 2858  IOM1 DI13: function
    rw(0x304F, 0x5A, "IOM1_IOfunct_DQ10", U16).inferred(),                                           // 2859  IOM1 DQ10: function
    rw(0x304F, 0x5B, "IOM1_IOfunct_DQ11", U16).inferred(),                                           // 2860  IOM1 DQ11: function
    rw(0x3050, 0x01, "ENC2_usage", U16).inferred(),                                                  // 2861  Encoder 2 (module): type of usage
    rw(0x3050, 0x02, "ENC_ModeOfMaEnc", U16).inferred(),                                             // 2862  Machine encoder mode
    rw(0x3050, 0x03, "ENC2_type", U16).inferred(),                                                   // 2863  Encoder 2 (module): encoder type
    rw(0x3050, 0x05, "ResolENC2Denom", I32).inferred(),                                              // 2864  Encoder 2 resolution: denominator
    rw(0x3050, 0x06, "ResolENC2Num", I32).inferred(),                                                // 2865  Encoder 2 resolution: numerator
    rw(0x3050, 0x07, "p_MaxDifToENC2", I32).inferred(),                                              // 2866  Maximum permitted deviation of the encoder positions
    rw(0x3050, 0x08, "InvertDirOfMaEnc", U16).inferred(),                                            // 2867  Machine encoder direction inversion
    rw(0x3050, 0x0E, "WakesAndShakeGain", U16).inferred(),                                           // 2868  Wake & Shake gain
    rw(0x3050, 0x0F, "ResolENC2", U32).inferred(),                                                   // 2869  Encoder 2: raw resolution
    rw(0x3051, 0x02, "ENCAAnaPowSupply", U16).inferred(),                                            // 2870  Analog encoder module (ANA): supply voltage
    ro(0x3051, 0x03, "_ENCAAnaHallStatu", U16).inferred(),                                           // 2871  Analog encoder: Hall sensor signal sequence
    rw(0x3051, 0x04, "ENC2SinCosMaxIx", I32).inferred(),                                             // 2872  SinCos encoder: maximum index pulse search distance
    ro(0x3051, 0x05, "_Enc2Cos", I16).inferred(),                                                    // 2873  Encoder 2: cosine signal
    ro(0x3051, 0x06, "_Enc2Sin", I16).inferred(),                                                    // 2874  Encoder 2: sine signal
    rw(0x3052, 0x01, "ENCDigSSIResSgl", U16).inferred(),                                             // 2875  SSI single-turn resolution (rotary)
    rw(0x3052, 0x02, "ENCDigSSIResMult", U16).inferred(),                                            // 2876  SSI multi-turn resolution (rotary)
    rw(0x3052, 0x03, "ENCDigSSICoding", U16).inferred(),                                             // 2877  SSI encoder position coding
    rw(0x3052, 0x04, "ENCDigPowSupply", U16).inferred(),                                             // 2878  Digital encoder module (DIG): supply voltage
    rw(0x3052, 0x05, "ENCDigSSIMaxFreq", U16).inferred(),                                            // 2879  SSI maximum transmission frequency
    rw(0x3052, 0x06, "ENCDigABIMaxFreq", U16).inferred(),                                            // 2880  ABI maximum frequency
    rw(0x3052, 0x07, "ENCDigABImaxIx", I32).inferred(),                                              // 2883  ABI: maximum index pulse search distance
    rw(0x3052, 0x08, "ENCDigBISSResSgl", U16).inferred(),                                            // 2884  BISS single-turn resolution
    rw(0x3052, 0x09, "ENCDigBISSResMul", U16).inferred(),                                            // 2885  BISS multi-turn resolution
    rw(0x3052, 0x0A, "ENCDigBISSCoding", U16).inferred(),                                            // 2886  BISS encoder position coding
    rw(0x3052, 0x0B, "ENCDigResMulUsed", U16).inferred(),                                            // 2887  Number of multi-turn bits of the encoder that are used
    rw(0x3052, 0x0C, "ENCDigSSILinRes", U16).inferred(),                                             // 2888  SSI linear encoder: resolution bits
    rw(0x3052, 0x0D, "ENCDigSSILinAdd", U16).inferred(),                                             // 2889  SSI linear encoder: additional bits
    rw(0x3052, 0x0E, "ENCDigLinBitsUsed", U16).inferred(),                                           // 2890  Linear encoder: number of position bits used
    rw(0x3052, 0x0F, "ENCDigEnDatBits", U16).inferred(),                                             // 2891  EnDat 2.2 encoder: evaluation of bits beyond 32
    // 6xxxh: device profile CiA 402 (lxm32m 2899-2943).
    ro(0x603F, 0, "_LastError", U16).t_pdo().inferred(),                                             // 2900  Last error that causes a stop (error classes 1 to 4)
    rw(0x6040, 0, "DCOMcontrol", U16).r_pdo(),                                                       // 2901  Controlword, see section 8
    ro(0x6041, 0, "_DCOMstatus", U16).t_pdo(),                                                       // 2902  Statusword, see section 8 (1295)
    rw(0x605B, 0, "DSM_ShutDownOption", I16).inferred(),                                             // 2903  Behaviour when the power stage is disabled during a movement
    rw(0x605D, 0, "LIM_HaltReaction", I16).assumed(1).inferred(),                                    // 2904  Halt option code
    rw(0x6060, 0, "DCOMopmode", I8).range(-6, 10).r_pdo(),                                           // 2905  Operating mode request, see section 9.1
    ro(0x6061, 0, "_DCOMopmd_act", I8).range(-6, 10).default(0).t_pdo(),                             // 2906  Active operating mode
    ro(0x6063, 0, "_p_act_int", I32).t_pdo().inferred(),                                             // 2907  Actual position, internal units
    ro(0x6064, 0, "_p_act", I32).unit("usr_p").t_pdo().inferred(),                                   // 2908  Actual position (user units)
    rw(0x6065, 0, "MON_p_dif_load", U32).assumed(16384).r_pdo().inferred(),                          // 2909  Maximum load-dependent position deviation (following error limit)
    rw(0x6067, 0, "MON_p_win", U32).assumed(16).r_pdo().inferred(),                                  // 2910  Standstill window: permitted control deviation
    rw(0x6068, 0, "MON_p_winTime", U16).assumed(0).inferred(),                                       // 2911  Standstill window: time
    ro(0x606B, 0, "_RAMP_v_act", I32).t_pdo().inferred(),                                            // 2912  Profile generator: actual velocity
    ro(0x606C, 0, "_v_act", I32).t_pdo().inferred(),                                                 // 2913  Actual velocity
    rw(0x606D, 0, "MON_v_win", U16).assumed(10).inferred(),                                          // 2914  Velocity window: permitted deviation
    rw(0x606E, 0, "MON_v_winTime", U16).assumed(0).inferred(),                                       // 2915  Velocity window: time
    rw(0x6071, 0, "PTtq_target", I16).range(-30000, 30000).default(0).unit("0.1 %").r_pdo(),         // 2916  Target torque, % of continuous stall torque _M_M_0 in 0.1 % steps
    ro(0x6077, 0, "_tq_act", I16).t_pdo().inferred(),                                                // 2917  Actual torque
    rw(0x607A, 0, "PPp_target", I32).unit("usr_p").r_pdo(),                                          // 2918  Profile Position target (usr_p)
    ro(0x607D, 0, "Software limits: number", U8).default(2),                                         // 383
    rw(0x607D, 1, "MON_swLimN", I32).assumed(-2147483648).inferred(),                                // 2919  Software limit switch, negative position
    rw(0x607D, 2, "MON_swLimP", I32).assumed(2147483647).inferred(),                                 // 2920  Software limit switch, positive position
    rw(0x607F, 0, "RAMP_v_max", U32).assumed(13200).inferred(),                                      // 2921  Maximum velocity of velocity motion profile (second cap on 60FFh, 1529)
    rw(0x6081, 0, "PPv_target", U32).assumed(60).r_pdo().inferred(),                                 // 2922  Profile Position target velocity
    rw(0x6083, 0, "RAMP_v_acc", U32).assumed(600).r_pdo().inferred(),                                // 2923  Profile acceleration
    rw(0x6084, 0, "RAMP_v_dec", U32).assumed(600).r_pdo().inferred(),                                // 2926  Profile deceleration
    rw(0x6087, 0, "RAMP_tq_slope", U32).assumed(10000).r_pdo().inferred(),                           // 2927  Torque profile slope
    rw(0x6098, 0, "HMmethod", I8).range(1, 35).default(18).r_pdo(),                                  // 2928  Homing method, see section 9.7
    rw(0x6099, 1, "HMv", U32).assumed(60).inferred(),                                                // 2929  Homing: velocity when searching the switch
    rw(0x6099, 2, "HMv_out", U32).assumed(6).inferred(),                                             // 2930  Homing: velocity when moving off the switch
    rw(0x60B8, 0, "TouchProbeFct", U16).r_pdo().inferred(),                                          // 2931  Touch probe function (DS402)
    ro(0x60B9, 0, "_TouchProbeStat", U16).t_pdo().inferred(),                                        // 2932  Touch probe status (DS402)
    ro(0x60BA, 0, "_Cap1PosRisEdge", I32).t_pdo().inferred(),                                        // 2933  Capture input 1: position at rising edge (DS402)
    ro(0x60BB, 0, "_Cap1PosFallEdge", I32).t_pdo().inferred(),                                       // 2934  Capture input 1: position at falling edge (DS402)
    ro(0x60BC, 0, "_Cap2PosRisEdge", I32).t_pdo().inferred(),                                        // 2935  Capture input 2: position at rising edge (DS402)
    ro(0x60BD, 0, "_Cap2PosFallEdge", I32).t_pdo().inferred(),                                       // 2936  Capture input 2: position at falling edge (DS402)
    rw(0x60C1, 1, "IPp_target", I32).unit("usr_p").r_pdo().inferred(),                               // 2937  Interpolated Position setpoint (usr_p with the mandatory 131072/rev scaling)
    rw(0x60C2, 1, "IP_IntTimPerVal", U8).assumed(2).unit("ms").inferred(),                           // 2938  Interpolation time period value
    rw(0x60C2, 2, "IP_IntTimInd", I8).assumed(-3).inferred(),                                        // 2939  Interpolation time index (power of ten, DS402 meaning)
    rw(0x60F2, 0, "PPoption", U16).inferred(),                                                       // 2940  Profile Position options
    ro(0x60F4, 0, "_p_dif", I32).t_pdo().inferred(),                                                 // 2941  Position deviation including dynamic part
    rw(0x60FF, 0, "PVv_target", I32).default(0).unit("usr_v").r_pdo(),                               // 2942  Target velocity (usr_v), capped by CTRL_v_max and RAMP_v_max
    ro(0x6502, 0, "_SuppDriveModes", U32).assumed(109).t_pdo().inferred(),                           // 2943  Supported operating modes per DSP402 (bit mask
]));

/// Which settings survive power-off once stored is in the drive's own manual: all those without a
/// printed word on it, assumed.
const fn keep_settings<const N: usize>(mut rows: [Entry; N]) -> [Entry; N] {
    let mut row = 0;
    while row < N {
        rows[row].persistent = rows[row].inferred && rows[row].access.writable();
        row += 1;
    }
    rows
}
