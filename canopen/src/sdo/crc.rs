//! The check of a block transfer (CiA 301): CRC-16 with polynomial 1021h, started at 0.

const TABLE: [u16; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = (byte as u16) << 8;
        let mut bit = 0;
        while bit < 8 {
            crc = crc << 1 ^ if crc & 0x8000 != 0 { 0x1021 } else { 0 };
            bit += 1;
        }
        table[byte] = crc;
        byte += 1;
    }
    table
};

/// The CRC of a whole object.
pub(super) fn crc(data: &[u8]) -> u16 {
    data.iter().fold(0, |crc, &byte| {
        crc << 8 ^ TABLE[usize::from((crc >> 8) as u8 ^ byte)]
    })
}

#[test]
fn check_value() {
    // CiA 301 gives 31C3h for the string "123456789".
    assert_eq!(crc(b"123456789"), 0x31C3);
}
