//! The object dictionary of the Twin Line controllers TLC53x: DSP-402 V1.0 on DS-301 V4.0.
//!
//! One row for each of the 342 entries that the manual prints (chapter 14 of its digest), with the
//! lines of its text in the name-sorted list and in the detail pages. The detail pages print no `rw`;
//! it is the list's. Where the manual prints one entry for all of an array, and for the entries of a
//! dynamic mapping beyond those that are mapped by default, [`TLC5XX`] has a row for each.

use syncline_canopen::dictionary::DataType::{I8, I16, I32, Text, U8, U16, U32};
use syncline_canopen::dictionary::{Entry, ro, rw, table, wo};

/// The whole table, a row for each object that answers.
pub static TLC5XX: &[Entry] = &table(expanded());

const ROWS: usize = PRINTED.len() + ARRAYS + MAPPINGS;

/// Entries of arrays besides the one printed of each: five of 40 records, eight of 64 list places,
/// 20 errors.
const ARRAYS: usize = 5 * 39 + 8 * 63 + 19;

/// Places of the six dynamic mappings beyond those of the default: 8 each (8108).
const MAPPINGS: usize = 2 * (7 + 6 + 6);

const fn expanded() -> [Entry; ROWS] {
    let mut rows = [PRINTED[0]; ROWS];
    let (mut row, mut printed) = (0, 0);
    while printed < PRINTED.len() {
        let entry = PRINTED[printed];
        let (index, last) = (entry.address.index, entry.address.sub);
        let is_array =
            matches!(index, 0x2100..=0x2104 | 0x2200..=0x2203 | 0x2300..=0x2303 | 0x2400);
        let mut sub = if is_array && last > 0 { 1 } else { last };
        while sub <= last {
            rows[row] = entry;
            rows[row].address.sub = sub;
            row += 1;
            sub += 1;
        }
        let ends = printed + 1 == PRINTED.len() || PRINTED[printed + 1].address.index != index;
        if matches!(index, 0x1600..=0x1602 | 0x1A00..=0x1A02) && ends {
            while sub <= 8 {
                rows[row] = rw(index, sub, "mapped object", U32).default(0).inferred();
                row += 1;
                sub += 1;
            }
        }
        printed += 1;
    }
    assert!(row == ROWS);
    rows
}

/// The entries as the manual prints them.
#[rustfmt::skip]
pub static PRINTED: &[Entry] = &[
    // 1xxxh: communication profile (6793-9133).
    ro(0x1000, 0, "device type", U32).default(0x0002_0192).persistent(), // 6094, 6793
    ro(0x1001, 0, "error register", U8), // 6139, 6814
    ro(0x1002, 0, "manufacturer status register", U32).default(0), // 6345, 6871
    rw(0x1003, 0, "number of errors", U8).range(0, 1).default(1), // 6388, 6914
    ro(0x1003, 1, "error field", U32).default(0), // 6135, 6926
    rw(0x1005, 0, "COB-ID SYNC", U32).default(0x8000_0080), // 6040, 6961
    rw(0x1006, 0, "communication cycle period", U32).default(0).unit("us"), // 6050, 7030
    rw(0x1007, 0, "synchronous window length", U32).default(0).unit("us"), // 6630, 7087
    ro(0x1008, 0, "manufacturer device name", Text(8)), // 6333, 7110
    ro(0x1009, 0, "manufacturer hardware version", Text(8)), // 6337, 7137
    ro(0x100A, 0, "manufacturer software version", Text(8)), // 6341, 7176
    rw(0x100C, 0, "guard time", U16).default(0).unit("ms"), // 6182, 7197
    rw(0x100D, 0, "life time faktor", U8).default(0), // 6312, 7257
    rw(0x1014, 0, "COB-ID EMCY", U32).default_plus_node(0x4000_0080), // 6028, 7290
    rw(0x1015, 0, "inhibit time EMCY", U16).default(0).unit("100 us"), // 6234, 7352
    ro(0x1016, 0, "number of elements", U8).default(1), // 6070, 7376
    rw(0x1016, 1, "Consumer Heartbeat Time", U32).default(0).unit("ms"), // 6074, 7388
    rw(0x1017, 0, "Producer Heartbeat Time", U16).default(0).unit("ms"), // 6490, 7437
    ro(0x1018, 0, "number of elements", U8).default(4), // 6232, 7469
    ro(0x1018, 1, "Vendor ID", U32).default(0x0100_002E), // 6780, 7481
    ro(0x1018, 2, "Product code", U32).default(0), // 6494, 7514
    ro(0x1018, 3, "Revision number", U32).default(0), // 6537, 7526
    ro(0x1018, 4, "Serial number", U32).default(0), // 6539, 7538
    ro(0x1400, 0, "number of elements", U8).default(5), // 5889, 7577
    rw(0x1400, 1, "COB-ID R_PDO1", U32).default_plus_node(0x0000_0200), // 6030, 7591
    rw(0x1400, 2, "transmission type R_PDO1", U8).default(255), // 6653, 7603
    rw(0x1400, 3, "inhibit time R_PDO1", U16).default(0).unit("100 us"), // 6237, 7617
    rw(0x1400, 4, "compatibility entry R_PDO1", U8).default(0), // 6054, 7631
    rw(0x1400, 5, "event timer R_PDO1", U16).default(0).unit("ms"), // 6143, 7645
    ro(0x1401, 0, "number of elements", U8).default(5), // 5929, 7793
    rw(0x1401, 1, "COB-ID R_PDO2", U32).default_plus_node(0x8000_0300), // 6032, 7805
    rw(0x1401, 2, "transmission type R_PDO2", U8).default(0), // 6657, 7818
    rw(0x1401, 3, "inhibit time R_PDO2", U16).default(0).unit("100 us"), // 6240, 7831
    rw(0x1401, 4, "compatibility entry R_PDO2", U8).default(0), // 6058, 7843
    rw(0x1401, 5, "event timer R_PDO2", U16).default(0).unit("ms"), // 6145, 7864
    ro(0x1402, 0, "number of elements", U8).default(5), // 5957, 7903
    rw(0x1402, 1, "COB-ID R_PDO3", U32).default_plus_node(0x8000_0400), // 6036, 7915
    rw(0x1402, 2, "transmission type R_PDO3", U8).default(0), // 6661, 7931
    rw(0x1402, 3, "inhibit time R_PDO3", U16).default(0).unit("100 us"), // 6243, 7945
    rw(0x1402, 4, "compatibility entry R_PDO3", U8).default(0), // 6062, 7959
    rw(0x1402, 5, "event timer R_PDO3", U16).default(0).unit("ms"), // 6147, 7972
    ro(0x1403, 0, "number of elements", U8).default(5), // 5973, 8012
    rw(0x1403, 1, "COB-ID R_PDO4", U32).default_plus_node(0x8000_0500), // 6038, 8019
    ro(0x1403, 2, "transmission type R_PDO4", U8).default(254), // 6665, 8026
    ro(0x1403, 3, "inhibit time R_PDO4", U16).default(0).unit("100 us"), // 6246, 8033
    ro(0x1403, 4, "compatibility entry R_PDO4", U8).default(0), // 6066, 8040
    rw(0x1403, 5, "event timer R_PDO4", U16).default(0).unit("ms"), // 6149, 8047
    rw(0x1600, 0, "number of elements", U8).default(1), // 5885, 8102
    rw(0x1600, 1, "1st mapped object R_PDO1", U32).default(0x6040_0010), // 5853, 8114
    rw(0x1601, 0, "number of elements", U8).default(2), // 5925, 8169
    rw(0x1601, 1, "1st mapped object R_PDO2", U32).default(0x6040_0010), // 5857, 8181
    rw(0x1601, 2, "2nd mapped object R_PDO2", U32).default(0x607A_0020), // 5901, 8193
    rw(0x1602, 0, "number of elements", U8).default(2), // 5953, 8251
    rw(0x1602, 1, "1st mapped object R_PDO3", U32).default(0x6040_0010), // 5861, 8263
    rw(0x1602, 2, "2nd mapped object R_PDO3", U32).default(0x60FF_0020), // 5905, 8275
    ro(0x1603, 0, "number of elements", U8).default(3), // 5969, 8328
    ro(0x1603, 1, "1st mapped object R_PDO4", U32).default(0x2090_0020), // 5865, 8340
    ro(0x1603, 2, "2nd mapped object R_PDO4", U32).default(0x20E8_0010), // 5909, 8352
    ro(0x1603, 3, "3rd mapped object R_PDO4", U32).default(0x20E9_0010), // 5941, 8364
    ro(0x1800, 0, "number of elements", U8).default(5), // 5897, 8402
    rw(0x1800, 1, "COB-ID T_PDO1", U32).default_plus_node(0x0000_0180), // 6042, 8414
    rw(0x1800, 2, "transmission type T_PDO1", U8).default(255), // 6669, 8426
    rw(0x1800, 3, "inhibit time T_PDO1", U16).default(0).unit("100 us"), // 6249, 8439
    rw(0x1800, 4, "reserved T_PDO1", U8).default(0), // 6526, 8451
    rw(0x1800, 5, "event timer T_PDO1", U16).default(0).unit("ms"), // 6151, 8463
    ro(0x1801, 0, "number of elements", U8).default(5), // 5937, 8508
    rw(0x1801, 1, "COB-ID T_PDO2", U32).default_plus_node(0x8000_0280), // 6044, 8520
    rw(0x1801, 2, "transmission type T_PDO2", U8).default(0), // 6673, 8533
    rw(0x1801, 3, "inhibit time T_PDO2", U16).default(0).unit("100 us"), // 6252, 8546
    rw(0x1801, 4, "reserved T_PDO2", U8).default(0), // 6529, 8558
    rw(0x1801, 5, "event timer T_PDO2", U16).default(0).unit("ms"), // 6153, 8582
    ro(0x1802, 0, "number of elements", U8).default(5), // 5965, 8617
    rw(0x1802, 1, "COB-ID T_PDO3", U32).default_plus_node(0x8000_0380), // 6046, 8629
    rw(0x1802, 2, "transmission type T_PDO3", U8).default(0), // 6677, 8642
    rw(0x1802, 3, "inhibit time T_PDO3", U16).default(0).unit("100 us"), // 6255, 8675
    rw(0x1802, 4, "reserved T_PDO3", U8).default(0).inferred(), // 6531, 8691
    rw(0x1802, 5, "event timer T_PDO3", U16).default(0).unit("ms"), // 6155, 8707
    ro(0x1803, 0, "number of elements", U8).default(5), // 5981, 8739
    rw(0x1803, 1, "COB-ID T_PDO4", U32).default_plus_node(0x8000_0480), // 6048, 8758
    ro(0x1803, 2, "transmission type T_PDO4", U8).default(254), // 6681, 8769
    ro(0x1803, 3, "inhibit time T_PDO4", U16).default(0).unit("100 us"), // 6258, 8782
    ro(0x1803, 4, "reserved T_PDO4", U8).default(0), // 6533, 8794
    rw(0x1803, 5, "event timer T_PDO4", U16).default(1000).unit("ms"), // 6157, 8807
    rw(0x1A00, 0, "number of elements", U8).default(1), // 5893, 8867
    rw(0x1A00, 1, "1st mapped object T_PDO1", U32).default(0x6041_0010), // 5869, 8879
    rw(0x1A01, 0, "number of elements", U8).default(2), // 5933, 8913
    rw(0x1A01, 1, "1st mapped object T_PDO2", U32).default(0x6041_0010), // 5873, 8936
    rw(0x1A01, 2, "2nd mapped object T_PDO2", U32).default(0x6064_0020), // 5913, 8948
    rw(0x1A02, 0, "number of elements", U8).default(2), // 5961, 8989
    rw(0x1A02, 1, "1st mapped object T_PDO3", U32).default(0x6041_0010), // 5877, 9001
    rw(0x1A02, 2, "2nd mapped object T_PDO3", U32).default(0x606C_0020), // 5917, 9024
    ro(0x1A03, 0, "number of elements", U8).default(3), // 5977, 9060
    ro(0x1A03, 1, "1st mapped object T_PDO4", U32).default(0x2089_0020), // 5881, 9072
    ro(0x1A03, 2, "2nd mapped object T_PDO4", U32).default(0x208A_0010), // 5921, 9084
    ro(0x1A03, 3, "3rd mapped object T_PDO4", U32).default(0x2091_0010), // 5949, 9113
    // 2007h…203Fh: device, capture, inputs and outputs.
    ro(0x2007, 0, "serial_number", U32), // 6541, 9150
    wo(0x2008, 0, "eeprSave", U16).default(0), // 6124, 9176
    wo(0x2009, 0, "default", U16).range(0, 2).default(0), // 6089, 9232
    rw(0x2010, 0, "p_maxDiff", U32).range(0, 131072).default(16384).unit("inc").persistent(), // 6420, 9294
    rw(0x2011, 0, "p_win", U16).default(10).unit("inc").persistent(), // 6451, 9321
    rw(0x2012, 0, "p_winTime", U16).range(0, 32767).default(16).unit("ms").persistent(), // 6454, 9343
    rw(0x2013, 0, "p_DifPeak", U32).default(0).unit("inc"), // 6410, 9399
    rw(0x2014, 0, "f_Chop", U16).range(0, 2).default(1).persistent(), // 6159, 9428
    rw(0x2016, 0, "TrigSign", U16).range(0, 15).default(4), // 6699, 9486
    rw(0x2017, 0, "TrigType", U16).range(0, 1).default(1), // 6706, 9524
    rw(0x2018, 0, "TrigLevl", U16).range(0, 3).default(1), // 6685, 9577
    rw(0x2019, 0, "TrigStart", U16).default(0), // 6702, 9615
    rw(0x2020, 0, "Name", Text(8)).persistent(), // 6384, 9678
    ro(0x2028, 0, "AnalogIn", U16).default(0).unit("mV"), // 6005, 9700
    ro(0x202A, 0, "TrigStat", U16).default(0), // 6704, 9723
    ro(0x202B, 0, "TrigPact1", I32).unit("inc"), // 6687, 9782
    ro(0x202C, 0, "TrigPact2", I32).unit("inc"), // 6690, 9802
    ro(0x202D, 0, "TrigPref1", I32).unit("inc"), // 6693, 9846
    ro(0x202E, 0, "TrigPref2", I32).unit("inc"), // 6696, 9875
    rw(0x2032, 0, "PULSE-C", U16).default(0).persistent(), // 6505, 9890
    rw(0x2035, 0, "RESO-C", U16).range(0, 3).default(2).persistent(), // 6535, 9932
    rw(0x203F, 0, "TL_BRC", U16).range(0, 1).default(0).persistent(), // 6640, 9956
    // 2040h…206Bh: control, status, monitoring, limits.
    rw(0x2040, 0, "driveCtrl", U16).range(0, 15).default(0).r_pdo(), // 6117, 10021
    ro(0x2041, 0, "driveStat", U16).default(0).t_pdo(), // 6121, 10070
    ro(0x2042, 0, "xMode_act", U16).default(0), // 6784, 10128
    rw(0x2043, 0, "SetCtrl", U16).range(0, 2).default(1), // 6543, 10150
    rw(0x2044, 0, "Filt_jerk", U16).default(0).persistent(), // 6162, 10197
    rw(0x2045, 0, "invertDir", U16).range(0, 1).default(0).persistent(), // 6263, 10226
    rw(0x2046, 0, "SignEnabl", U16).range(0, 15).default(15).persistent(), // 6548, 10276
    rw(0x2047, 0, "SignLevel", U16).range(0, 15).default(0).persistent(), // 6549, 10309
    ro(0x2048, 0, "Sign_SR", U16).default(0), // 6545, 10362
    ro(0x2049, 0, "FltSig", U32).default(0), // 6174, 10399
    ro(0x204A, 0, "FltSig_SR", U32).default(0), // 6176, 10443
    ro(0x204B, 0, "action_st", U16).default(0), // 5999, 10467
    rw(0x204C, 0, "SignQstop", U16).default(0).persistent(), // 6555, 10488
    rw(0x204D, 0, "I_maxSTOP", U16).range(0, 29999).default(1000).unit("0.01 A").persistent(), // 6218, 10544
    rw(0x204F, 0, "Flt_pDiff", U16).range(0, 3).default(3).persistent(), // 6172, 10566
    rw(0x2050, 0, "I_maxMan", U16).range(0, 29999).default(1000).unit("0.01 A").persistent(), // 6213, 10611
    rw(0x2052, 0, "SW_LimP", I32).default(2147483647).unit("usr").persistent(), // 6627, 10634
    rw(0x2053, 0, "SW_LimN", I32).default(-2147483648).unit("usr").persistent(), // 6624, 10682
    rw(0x2054, 0, "SW_Enabl", U16).default(0).persistent(), // 6622, 10707
    rw(0x205A, 0, "n_max0", I32).range(1, 12000).default(3000).unit("r/min").persistent(), // 6372, 10734
    rw(0x205B, 0, "n_start0", I32).range(0, 6000).default(12).unit("usr").persistent(), // 6381, 10775
    rw(0x205C, 0, "v_target0", I32).range(1, 2147483647).default(60).unit("usr").persistent(), // 6758, 10796
    rw(0x205D, 0, "acc_type", U16).range(1, 2).default(1).persistent(), // 5990, 10818
    rw(0x205E, 0, "acc", U32).range(60, 2000000).default(600).unit("usr").persistent(), // 5985, 10867
    rw(0x205F, 0, "dec", U32).range(60, 2000000).default(600).unit("usr").persistent(), // 6084, 10889
    rw(0x2060, 0, "OnlAuto", U16).range(0, 1).default(0), // 6390, 10928
    rw(0x2061, 0, "IO_mode", U16).range(0, 2).default(0).persistent(), // 6265, 10964
    ro(0x2062, 0, "IntSigSr", U32).default(0), // 6261, 11006
    rw(0x2065, 0, "I_0", U16).range(0, 1000).default(90).unit("0.01 A rms").persistent(), // 6188, 11031
    rw(0x2066, 0, "I_acc", U16).range(0, 1000).default(90).unit("0.01 A rms").persistent(), // 6194, 11067
    rw(0x2067, 0, "I_const", U16).range(0, 1000).default(90).unit("0.01 A rms").persistent(), // 6200, 11089
    rw(0x2068, 0, "n_90%", U32).range(1, 3000).assumed(1).unit("r/min").persistent(), // 6367, 11112
    rw(0x2069, 0, "n_50%", U32).range(1, 3000).assumed(1).unit("r/min").persistent(), // 6365, 11153
    rw(0x206A, 0, "SM_toggle", U16).range(0, 1).default(1).persistent(), // 6558, 11180
    rw(0x206B, 0, "monitorM", U16).persistent(), // 6360, 11221
    // 2070h…208Dh: status of motion.
    ro(0x2070, 0, "ActCtrl", U16).default(1), // 5997, 11246
    ro(0x2071, 0, "p_ref", I32).unit("inc"), // 6427, 11266
    ro(0x2072, 0, "p_act", I32).unit("inc").t_pdo(), // 6400, 11304
    ro(0x2073, 0, "p_dif", I32).unit("inc").t_pdo(), // 6408, 11323
    ro(0x2074, 0, "n_ref", I16).default(0).unit("r/min"), // 6377, 11340
    ro(0x2075, 0, "n_act", I16).default(0).unit("r/min").t_pdo(), // 6369, 11380
    ro(0x2076, 0, "I_ref", I16).default(0).unit("0.01 A"), // 6224, 11398
    ro(0x2077, 0, "I_act", I16).default(0).unit("0.01 A").t_pdo(), // 6197, 11416
    ro(0x2078, 0, "p_abs", U16).default(0).unit("inc").t_pdo(), // 6391, 11454
    ro(0x2079, 0, "I2tM_act", I16).default(0).unit("%"), // 6228, 11474
    ro(0x207A, 0, "I2tPA_act", I16).unit("%"), // 6230, 11509
    ro(0x207B, 0, "I2tB_act", I16).default(0).unit("%"), // 6226, 11544
    ro(0x207C, 0, "UDC_act", I16).unit("0.1 V"), // 6732, 11564
    ro(0x207F, 0, "TM_act", I16).unit("deg C"), // 6643, 11585
    ro(0x2080, 0, "TPA_act", I16).unit("deg C"), // 6651, 11627
    ro(0x2081, 0, "p_refGear", I32).unit("inc").t_pdo(), // 6429, 11653
    ro(0x2082, 0, "v_refGear", I32).unit("inc/s"), // 6749, 11690
    ro(0x2083, 0, "v_ref", I32).unit("inc/s"), // 6746, 11721
    ro(0x2084, 0, "acc_ref", U16).default(1).unit("r/(min*s)"), // 5987, 11739
    ro(0x2085, 0, "p_target", I32).unit("usr"), // 6445, 11759
    ro(0x2086, 0, "p_jerkusr", I32).unit("usr").t_pdo(), // 6417, 11782
    ro(0x2087, 0, "p_tarOffs", I32).unit("inc"), // 6448, 11804
    ro(0x2088, 0, "p_refOffs", I32).unit("inc").t_pdo(), // 6432, 11849
    ro(0x2089, 0, "p_actusr", I32).unit("usr").t_pdo(), // 6405, 11874
    ro(0x208A, 0, "v_jerkusr", I32).unit("usr").t_pdo(), // 6743, 11894
    ro(0x208B, 0, "n_refOffs", I32).unit("r/min"), // 6378, 11940
    ro(0x208C, 0, "p_remaind", I32).unit("inc"), // 6442, 11971
    ro(0x208D, 0, "v_target", I32).unit("usr"), // 6755, 12009
    // 2090h…20AFh: the manufacturer's modes.
    rw(0x2090, 0, "p_absPTP", I32).default(0).unit("usr").r_pdo(), // 6396, 12023
    ro(0x2091, 0, "StatePTP", U16).default(0).t_pdo(), // 6602, 12048
    rw(0x2092, 0, "p_relPTP", I32).default(0).unit("usr").r_pdo(), // 6438, 12118
    rw(0x2093, 0, "continue", U16).default(0), // 6078, 12142
    rw(0x2094, 0, "v_tarPTP", I32).unit("usr").r_pdo(), // 6760, 12185
    rw(0x2095, 0, "velocity", I32).default(0).unit("usr").r_pdo(), // 6767, 12212
    ro(0x2096, 0, "StateVEL", U16), // 6610, 12238
    rw(0x209C, 0, "dirEnGear", U16).range(1, 3).default(3), // 6100, 12310
    rw(0x209D, 0, "startGear", U16).range(0, 3).default(0).r_pdo(), // 6571, 12369
    ro(0x209E, 0, "stateGear", U16), // 6590, 12407
    rw(0x209F, 0, "n_maxGear", I32).range(1, 12000).default(3000).unit("r/min").persistent(), // 6375, 12475
    rw(0x20A1, 0, "numGear", I32).default(1), // 6389, 12498
    rw(0x20A2, 0, "denGear", I32).range(1, 2147483647).default(1), // 6092, 12520
    rw(0x20A4, 0, "p_absOffs", I32).default(0).unit("inc"), // 6393, 12563
    ro(0x20A5, 0, "stateOffs", U16), // 6600, 12587
    rw(0x20A6, 0, "p_relOffs", I32).default(0).unit("inc"), // 6435, 12637
    rw(0x20A7, 0, "n_tarOffs", I32).range(-12000, 12000).default(60).unit("inc/s"), // 6382, 12663
    rw(0x20A8, 0, "phomeOffs", I32).default(0).unit("inc"), // 6458, 12686
    rw(0x20A9, 0, "startMan", U16).range(0, 7).default(0).r_pdo(), // 6581, 12731
    rw(0x20AA, 0, "typeMan", U16).range(0, 1).default(0).persistent(), // 6727, 12757
    rw(0x20AB, 0, "n_slowMan", U32).range(1, 2147483647).default(60).unit("usr").persistent(), // 6380, 12806
    rw(0x20AC, 0, "n_fastMan", U32).range(1, 2147483647).default(180).unit("usr").persistent(), // 6370, 12829
    rw(0x20AD, 0, "dist_Man", U16).range(1, 65535).default(20).unit("usr").persistent(), // 6104, 12855
    rw(0x20AE, 0, "step_Man", U16).default(20).unit("usr").persistent(), // 6616, 12900
    rw(0x20AF, 0, "time_Man", U16).range(1, 30000).default(500).unit("ms").persistent(), // 6638, 12923
    // 20B0h…20F9h: teach-in, lists, records, homing.
    rw(0x20B0, 0, "storeTeac", U16).default(0), // 6619, 12944
    ro(0x20B1, 0, "stateTeac", U16), // 6607, 13003
    rw(0x20B2, 0, "memNrTeac", U16).range(1, 3).default(1), // 6355, 13034
    ro(0x20B3, 0, "p_actTeac", I32).default(0).unit("usr"), // 6402, 13086
    rw(0x20B4, 0, "startList", U16).range(0, 2).default(0), // 6577, 13111
    ro(0x20B5, 0, "stateList", U16).default(0), // 6595, 13168
    rw(0x20B7, 0, "cntList1", U16).range(0, 64).default(64), // 6021, 13205
    rw(0x20B8, 0, "bgnList1", U16).range(0, 63).default(0), // 6012, 13243
    rw(0x20B9, 0, "endList1", U16).range(0, 63).default(63).persistent(), // 6127, 13279
    ro(0x20BA, 0, "actList1", I16).default(-1), // 6001, 13305
    rw(0x20BD, 0, "cntList2", U16).range(0, 64).default(64), // 6024, 13367
    rw(0x20BE, 0, "bgnList2", U16).range(0, 63).default(0), // 6015, 13406
    rw(0x20BF, 0, "endList2", U16).range(0, 63).default(63), // 6130, 13444
    ro(0x20C0, 0, "actList2", I16).default(-1), // 6003, 13486
    rw(0x20D0, 0, "startRec", U16).range(0, 50).default(0).r_pdo(), // 6584, 13513
    ro(0x20D1, 0, "stateRec", U16).default(0), // 6604, 13555
    rw(0x20D2, 0, "UpRamp1", U32).range(60, 2000000).default(600).unit("usr"), // 6734, 13610
    rw(0x20D3, 0, "DnRamp1", U32).range(60, 2000000).default(600).unit("usr"), // 6108, 13658
    rw(0x20D4, 0, "UpRamp2", U32).range(60, 2000000).default(600).unit("usr"), // 6736, 13682
    rw(0x20D5, 0, "DnRamp2", U32).range(60, 2000000).default(600).unit("usr"), // 6110, 13703
    rw(0x20D6, 0, "UpRamp3", U32).range(60, 2000000).default(600).unit("usr"), // 6738, 13748
    rw(0x20D7, 0, "DnRamp3", U32).range(60, 2000000).default(600).unit("usr"), // 6112, 13777
    rw(0x20E8, 0, "v_tar16", U16).unit("usr").r_pdo(), // 6752, 13803
    rw(0x20E9, 0, "ramp", U16).default(600).unit("usr").r_pdo(), // 6511, 13850
    ro(0x20EB, 0, "v_jerk16", U16).unit("usr").t_pdo(), // 6740, 13874
    rw(0x20F0, 0, "startHome", U16).range(1, 8).default(3).r_pdo(), // 6575, 13914
    ro(0x20F1, 0, "stateHome", U16).default(0), // 6593, 13952
    rw(0x20F3, 0, "p_outHome", U32).range(0, 2147483647).default(0).unit("usr").persistent(), // 6423, 14014
    rw(0x20F4, 0, "p_disHome", U32).range(0, 2147483647).default(200).unit("usr").persistent(), // 6414, 14046
    ro(0x20F5, 0, "stateMan", U16).default(0), // 6598, 14094
    rw(0x20F6, 0, "startSetp", I32).default(0).unit("usr"), // 6587, 14141
    rw(0x20F8, 0, "accOffs", I32).range(60, 2000000).default(600).unit("r/(min*s)"), // 5994, 14185
    rw(0x20F9, 0, "decOffs", I32).range(60, 2000000).default(600).unit("r/(min*s)"), // 6086, 14209
    // 2100h…2400h: one row stands for all entries of an array.
    rw(0x2100, 0, "Record_Type: number_of_records", U16).range(1, 40).default(40), // 6522, 14234
    rw(0x2100, 0x28, "Record_Type: TypeRecord", U16).range(1, 2).default(1), // 6729, 14246
    rw(0x2101, 0, "Record_Mass: number_of_records", U16).range(1, 40).default(40), // 6516, 14295
    rw(0x2101, 0x28, "Record_Mass: MassRecord", U16).range(1, 2).default(1), // 6349, 14307
    rw(0x2102, 0, "Record_Position: number_of_records", I32).range(1, 40).default(40), // 6518, 14353
    rw(0x2102, 0x28, "Record_Position: PosRecord", I32).default(1).unit("usr"), // 6484, 14365
    rw(0x2103, 0, "Record_Velocity: number_of_records", I32).range(1, 40).default(40), // 6524, 14391
    rw(0x2103, 0x28, "Record_Velocity: VelRecord", I32).default(1).unit("usr"), // 6778, 14403
    rw(0x2104, 0, "Record_Ramp: number_of_records", U16).range(1, 40).default(40), // 6520, 14437
    rw(0x2104, 0x28, "Record_Ramp: RampRecord", U16).range(0, 3).default(0), // 6514, 14444
    rw(0x2200, 0, "List1_Type: number_of_records", U16).range(1, 64).default(64), // 6319, 14483
    rw(0x2200, 0x40, "List1_Type: typeList1", U16).range(1, 2).default(1).persistent(), // 6719, 14498
    rw(0x2201, 0, "List1_Position: number_of_records", I32).range(1, 64).default(64), // 6315, 14542
    rw(0x2201, 0x40, "List1_Position: posList1", I32).default(0).unit("usr [INF]").persistent(), // 6480, 14554
    rw(0x2202, 0, "List1_Signal: number_of_records", U16).range(1, 64).default(64), // 6317, 14581
    rw(0x2202, 0x40, "List1_Signal: signList1", U16).range(0, 1).default(0).persistent(), // 6551, 14593
    rw(0x2203, 0, "List1_Velocity: number_of_records", I32).range(1, 64).default(64), // 6321, 14637
    rw(0x2203, 0x40, "List1_Velocity: velList1", I32).default(0).unit("usr [INF]").persistent(), // 6763, 14649
    rw(0x2300, 0, "List2_Type: number_of_records", U16).range(1, 64).default(64), // 6327, 14678
    rw(0x2300, 0x40, "List2_Type: typeList2", U16).range(1, 2).default(1).persistent(), // 6722, 14690
    rw(0x2301, 0, "List2_Position: number_of_records", I32).range(1, 64).default(64), // 6323, 14736
    rw(0x2301, 0x40, "List2_Position: posList2", I32).default(0).unit("usr [INF]").persistent(), // 6482, 14748
    rw(0x2302, 0, "List2_Signal: number_of_records", U16).range(1, 64).default(64), // 6325, 14775
    rw(0x2302, 0x40, "List2_Signal: signList2", U16).range(0, 1).default(0).persistent(), // 6553, 14802
    rw(0x2303, 0, "List2_Velocity: number_of_records", I32).range(1, 64).default(64), // 6329, 14831
    rw(0x2303, 0x40, "List2_Velocity: velList2", I32).default(0).unit("usr [INF]").persistent(), // 6765, 14843
    rw(0x2400, 0, "Error-Field: number_of_records", U16).range(0, 20).default(20).inferred(), // 6141, 14879
    rw(0x2400, 0x14, "Error-Field: error number", U16).default(0), // 6137, 14913
    // 603Fh…6510h: drive profile (DSP-402 V1.0).
    ro(0x603F, 0, "error code", U16).default(0), // 6133, 14934
    rw(0x6040, 0, "controlword", U16).default(0).r_pdo(), // 6081, 14960
    ro(0x6041, 0, "statusword", U16).t_pdo(), // 6613, 15075
    wo(0x6060, 0, "modes of operation", I8).range(-1, 127).default(1).r_pdo(), // 6357, 15209
    rw(0x6061, 0, "modes of operation display", I8).range(-1, 127).default(1).t_pdo().inferred(), // 6358, 15244
    ro(0x6063, 0, "position actual value*", I32).unit("inc"), // 6468, 15302
    ro(0x6064, 0, "position actual value", I32).unit("usr").t_pdo(), // 6466, 15327
    rw(0x6068, 0, "position window time", U16).range(0, 32767).default(16).unit("ms"), // 6476, 15375
    ro(0x6069, 0, "velocity sensor actual value", I32).unit("inc/s").t_pdo(), // 6774, 15405
    ro(0x606C, 0, "velocity actual value", I32).default(1).unit("usr").t_pdo(), // 6770, 15441
    rw(0x607A, 0, "target position", I32).default(0).unit("usr").r_pdo(), // 6634, 15474
    ro(0x607D, 0, "number of elements", U8).default(2), // 6561, 15515
    rw(0x607D, 1, "min position limit", I32).default(-2147483648).unit("usr").persistent(), // 6356, 15527
    rw(0x607D, 2, "max position limit", I32).default(2147483647).unit("usr").persistent(), // 6351, 15538
    rw(0x607F, 0, "max profile velocity", U32).range(1, 12000).default(3000).unit("usr").persistent(), // 6353, 15575
    rw(0x6081, 0, "profile velocity", U32).unit("usr").r_pdo(), // 6502, 15627
    rw(0x6083, 0, "profile acceleration", U32).range(60, 2000000).default(600).unit("usr").r_pdo(), // 6496, 15651
    rw(0x6084, 0, "profile deceleration", U32).range(60, 2000000).default(600).unit("usr").r_pdo(), // 6499, 15680
    rw(0x6085, 0, "quick stop deceleration", U32).range(60, 2000000).default(600).unit("rev/(min*s)").persistent(), // 6507, 15725
    rw(0x6086, 0, "motion profile type", I16).range(-1, 0).default(0).persistent(), // 6361, 15747
    ro(0x6093, 0, "number of elements", U8).default(2), // 6474, 15775
    rw(0x6093, 1, "pNormNum", I32).default(1).persistent(), // 6464, 15787
    rw(0x6093, 2, "pNormDen", I32).default(16384).persistent(), // 6462, 15799
    ro(0x6094, 0, "number of elements", U8).default(2), // 6772, 15822
    rw(0x6094, 1, "vNormNum", I32).range(1, 2147483647).default(1).persistent(), // 6783, 15829
    rw(0x6094, 2, "vNormDen", I32).range(1, 2147483647).default(1).persistent(), // 6782, 15845
    ro(0x6097, 0, "number of elements", U8).default(2), // 5992, 15870
    rw(0x6097, 1, "aNormNum", I32).range(1, 2147483647).default(1).persistent(), // 6010, 15882
    rw(0x6097, 2, "aNormDen", I32).range(1, 2147483647).default(1).persistent(), // 6008, 15895
    rw(0x6098, 0, "homing method", I8).range(0, 127).default(18), // 6184, 15938
    ro(0x6099, 0, "number of elements", U8).default(2), // 6186, 16010
    rw(0x6099, 1, "speed during search for switch", I32).default(60).unit("usr").persistent(), // 6563, 16022
    rw(0x6099, 2, "speed during search for zero", I32).default(6).unit("usr").persistent(), // 6567, 16033
    rw(0x60F4, 0, "following error actual value", I32).default(0).unit("usr").inferred(), // 6178, 16058
    ro(0x60FB, 0, "number of elements", U16).default(24), // 6470, 16088
    rw(0x60FB, 1, "I_max1", U16).range(0, 29999).default(1000).unit("0.01 A").persistent(), // 6202, 16095
    rw(0x60FB, 2, "I_max2", U16).range(0, 29999).default(1000).unit("0.01 A").persistent(), // 6207, 16103
    rw(0x60FB, 3, "n_max1", U16).range(0, 12000).default(6000).unit("r/min").persistent(), // 6373, 16111
    rw(0x60FB, 4, "n_max2", U16).range(0, 12000).default(6000).unit("r/min").persistent(), // 6374, 16118
    rw(0x60FB, 5, "KPn1", U16).range(0, 32767).default(10).unit("A*min/rev ×1000").persistent(), // 6299, 16125
    rw(0x60FB, 6, "KPn2", U16).range(0, 32767).default(10).unit("1/1000 A*min/rev").persistent(), // 6302, 16140
    rw(0x60FB, 7, "TNn1", U16).range(0, 32767).default(500).unit("0.01 ms").persistent(), // 6645, 16155
    rw(0x60FB, 8, "TNn2", U16).range(0, 32767).default(500).unit("0.01 ms").persistent(), // 6648, 16170
    rw(0x60FB, 9, "TVn1", U16).range(0, 32767).default(0).unit("0.01 ms").persistent(), // 6707, 16185
    rw(0x60FB, 0x0A, "TVn2", U16).range(0, 32767).default(0).unit("0.01 ms").persistent(), // 6710, 16200
    rw(0x60FB, 0x0B, "KFPn1", U16).range(0, 32767).default(0).unit("0.01 A*min/rev").persistent(), // 6285, 16216
    rw(0x60FB, 0x0C, "KFPn2", U16).range(0, 32767).default(0).unit("0.01 A*min/rev").persistent(), // 6289, 16231
    rw(0x60FB, 0x0D, "KFDn1", U16).range(0, 32767).default(0).unit("1/10000 mA*s*min/rev").persistent(), // 6277, 16246
    rw(0x60FB, 0x0E, "KFDn2", U16).range(0, 32767).default(0).unit("1/10000 mA*s*min/rev").persistent(), // 6281, 16262
    rw(0x60FB, 0x0F, "KPp1", U16).range(0, 32767).default(14).unit("0.1 1/s").persistent(), // 6305, 16278
    rw(0x60FB, 0x10, "KPp2", U16).range(0, 32767).default(14).unit("0.1 1/s").persistent(), // 6309, 16292
    rw(0x60FB, 0x11, "TVp1", U16).range(0, 32767).default(0).unit("0.01 ms").persistent(), // 6713, 16305
    rw(0x60FB, 0x12, "TVp2", U16).range(0, 32767).default(0).unit("0.01 ms").persistent(), // 6716, 16320
    rw(0x60FB, 0x13, "KFPp1", U16).range(0, 32767).default(100).persistent(), // 6293, 16335
    rw(0x60FB, 0x14, "KFPp2", U16).range(0, 32767).default(100).persistent(), // 6296, 16350
    rw(0x60FB, 0x15, "KFAp1", U16).range(0, 32767).default(0).unit("1/10000 A*s*min/rev").persistent(), // 6268, 16365
    rw(0x60FB, 0x16, "KFAp2", U16).range(0, 32767).default(0).unit("1/10000 mA*s*min/rev").persistent(), // 6272, 16380
    rw(0x60FB, 0x17, "Filt_nRef1", U16).range(0, 32767).default(0).unit("0.01 ms").persistent(), // 6164, 16403
    rw(0x60FB, 0x18, "Filt_nRef2", U16).range(0, 32767).default(0).unit("0.01 ms").persistent(), // 6168, 16418
    ro(0x60FD, 0, "digital inputs", U32).t_pdo(), // 6096, 16443
    ro(0x60FE, 0, "number of elements", U8).default(2), // 6098, 16509
    rw(0x60FE, 1, "physical outputs", U32).default(0).r_pdo(), // 6460, 16521
    rw(0x60FE, 2, "bitmask", U32).default(0), // 6018, 16533
    rw(0x60FF, 0, "target velocity", I32).default(0).unit("usr").r_pdo(), // 6636, 16610
    ro(0x6404, 0, "motor manufacturer", Text(16)).default_text("SIG Positec BL").persistent(), // 6363, 16640
    ro(0x6410, 0, "number of elements", U8).default(7), // 6362, 16666
    rw(0x6410, 1, "TypeM", I32).persistent(), // 6725, 16673
    rw(0x6410, 5, "n_nomM", U16).range(0, 12000).default(3000).unit("r/min").persistent(), // 6376, 16681
    rw(0x6410, 6, "I_maxM", U16).range(0, 32767).default(1000).unit("0.01 A").persistent(), // 6211, 16688
    rw(0x6410, 7, "I_nomM", U16).range(0, 32767).default(100).unit("0.01 A").persistent(), // 6220, 16703
    rw(0x6410, 8, "M_nomM", U16).range(0, 32767).default(100).unit("N*cm").persistent(), // 6331, 16715
    rw(0x6410, 0x28, "nameM", Text(16)).persistent(), // 6386, 16727
    rw(0x6410, 0x29, "I_0M", U16).range(1, 32767).default(100).unit("0.01 A").persistent(), // 6191, 16740
    ro(0x6510, 0, "number of elements", U8).default(2), // 6114, 16767
    ro(0x6510, 1, "I_maxPA", U16).default(1000).unit("0.01 A"), // 6216, 16778
    ro(0x6510, 2, "I_nomPA", U16).default(300).unit("0.01 A"), // 6222, 16791
];
