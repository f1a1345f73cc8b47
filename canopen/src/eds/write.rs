//! A data sheet written as a file, in the order that CiA 306 has.

use super::{Eds, Object, Parameter, Value};
use core::fmt;

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => number.fmt(f),
            Self::PlusNode(number) => write!(f, "$NODEID+0x{number:X}"),
            Self::Text(text) => text.fmt(f),
        }
    }
}

/// Writes the file. Every line ends in CR LF, as CiA 306 wants it.
impl fmt::Display for Eds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        section(f, "FileInfo", &self.file)?;
        section(f, "DeviceInfo", &self.device)?;
        write!(f, "[DummyUsage]\r\n")?;
        for (number, &used) in (1..).zip(&self.dummies) {
            write!(f, "Dummy{number:04}={}\r\n", u8::from(used))?;
        }
        write!(f, "\r\n")?;
        let mandatory = |index: u16| matches!(index, 0x1000 | 0x1001 | 0x1018);
        let manufacturer = |index: u16| (0x2000..0x6000).contains(&index);
        self.list(f, "MandatoryObjects", mandatory)?;
        self.list(f, "OptionalObjects", |index| {
            !mandatory(index) && !manufacturer(index)
        })?;
        self.list(f, "ManufacturerObjects", manufacturer)?;
        for (index, object) in &self.objects {
            object.write(f, *index)?;
        }
        Ok(())
    }
}

impl Eds {
    fn list(
        &self,
        f: &mut fmt::Formatter<'_>,
        name: &str,
        holds: impl Fn(u16) -> bool,
    ) -> fmt::Result {
        let indices = || self.objects.keys().filter(|&&index| holds(index));
        write!(f, "[{name}]\r\nSupportedObjects={}\r\n", indices().count())?;
        for (number, index) in (1..).zip(indices()) {
            write!(f, "{number}=0x{index:04X}\r\n")?;
        }
        write!(f, "\r\n")
    }
}

impl Object {
    fn write(&self, f: &mut fmt::Formatter<'_>, index: u16) -> fmt::Result {
        let object_type = self.object_type as u8;
        write!(f, "[{index:04X}]\r\nParameterName={}\r\n", self.name)?;
        write!(f, "ObjectType=0x{object_type:X}\r\n")?;
        if !self.object_type.has_subs() {
            return match self.subs.get(&0) {
                Some(value) => value.write(f, false),
                None => write!(f, "\r\n"),
            };
        }
        write!(f, "SubNumber={}\r\n\r\n", self.subs.len())?;
        for (sub, value) in &self.subs {
            write!(f, "[{index:04X}sub{sub:X}]\r\n")?;
            write!(f, "ParameterName={}\r\nObjectType=0x7\r\n", value.name)?;
            // Index, subindex and length: in hexadecimal a person sees them.
            let maps = sub > &0 && matches!(index, 0x1600..0x1800 | 0x1A00..0x1C00);
            value.write(f, maps)?;
        }
        Ok(())
    }
}

impl Parameter {
    /// All but name and object type; the default of what `maps` an object in hexadecimal.
    fn write(&self, f: &mut fmt::Formatter<'_>, maps: bool) -> fmt::Result {
        write!(f, "DataType=0x{:04X}\r\n", self.data_type)?;
        write!(f, "AccessType={}\r\n", self.access)?;
        for (key, value) in [
            ("LowLimit", &self.low),
            ("HighLimit", &self.high),
            ("DefaultValue", &self.default),
        ] {
            match value {
                Some(Value::Number(object)) if maps => write!(f, "{key}=0x{object:08X}\r\n")?,
                Some(value) => write!(f, "{key}={value}\r\n")?,
                None => {}
            }
        }
        write!(f, "PDOMapping={}\r\n\r\n", u8::from(self.pdo_mapping))
    }
}

fn section(f: &mut fmt::Formatter<'_>, name: &str, pairs: &[(String, String)]) -> fmt::Result {
    write!(f, "[{name}]\r\n")?;
    for (key, value) in pairs {
        write!(f, "{key}={value}\r\n")?;
    }
    write!(f, "\r\n")
}
