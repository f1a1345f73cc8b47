//! Absolute rotary encoders by CiA 406: one T_PDO brings the position value (6004h) as four bytes, which begins anew
//! behind its range.

use crate::model::{Feedback, Increments, Mapping, NodeSpec, RemoteNode, Sample};
use syncline_canopen::{Address, Frame};

/// The position value, as it is mapped.
pub(in crate::model) const POSITION: u32 = 0x6004_0020;

/// An encoder whose first T_PDO is its position. What the bytes of its EMCY mean is not known of it.
#[derive(Clone, Debug)]
pub(in crate::model) struct AbsoluteEncoder {
    pub(in crate::model) spec: NodeSpec,
    /// What that T_PDO carries.
    pub(in crate::model) pdo: Mapping,
    /// After so many increments the position begins anew.
    pub(in crate::model) range: Increments,
}

/// Communication, how it counts and the preset are not the user's to write on a machine that is being switched on.
pub(in crate::model) fn reserved(Address { index, .. }: Address) -> bool {
    matches!(index, 0x1000..=0x1FFF | 0x6000..=0x6003 | 0x6200)
}

impl RemoteNode for AbsoluteEncoder {
    fn spec(&self) -> &NodeSpec {
        &self.spec
    }

    fn mapped(&self) -> Vec<&Mapping> {
        vec![&self.pdo]
    }
}

impl Feedback for AbsoluteEncoder {
    fn sample(&self, _: usize, data: &[u8]) -> Option<Sample> {
        let arranged = self.pdo.arranged(data);
        let &[p0, p1, p2, p3] = arranged.data() else {
            return None;
        };
        let position = u32::from_le_bytes([p0, p1, p2, p3]);
        Some(Sample {
            position: Increments::new(position.into()),
        })
    }

    fn range(&self) -> Option<Increments> {
        Some(self.range)
    }

    fn in_motion(&self, position: Increments) -> Vec<Frame> {
        let position = position.get().rem_euclid(self.range.get()) as u32;
        let cob_id = self.spec.t_pdos[0].cob_id;
        vec![self.pdo.frame(cob_id, &position.to_le_bytes())]
    }
}
