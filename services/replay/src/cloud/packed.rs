//! Clouds as messages carry them: points of equal length one after the other, and fields at offsets in them.

use super::Cloud;
use super::fields::{Meanings, UNREADABLE};
use super::value::Kind;

/// A field of a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Field<'a> {
    pub(crate) name: &'a str,
    pub(crate) kind: Kind,
    /// Offset in the point [bytes].
    pub(crate) offset: usize,
}

/// A cloud whose fields lie within its points.
#[derive(Debug)]
pub(crate) struct Packed<'a> {
    fields: Vec<Field<'a>>,
    meanings: Meanings,
    rows: usize,
    /// Points of a row.
    columns: usize,
    point_bytes: usize,
    row_bytes: usize,
    is_big_endian: bool,
    data: &'a [u8],
    /// The cloud's own time [ns]; 0 where it has none.
    start_ns: u64,
}

/// What was left out of a cloud.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LeftOut {
    /// Points that were promised and are not there.
    pub(crate) missing: u64,
    /// Intensities that were clamped.
    pub(crate) clamped: u64,
}

impl<'a> Packed<'a> {
    /// A cloud of rows × columns points, with bytes from point to point and from row to row. Says what contradicts.
    pub(crate) fn checked(
        fields: Vec<Field<'a>>,
        [rows, columns]: [usize; 2],
        [point_bytes, row_bytes]: [usize; 2],
        is_big_endian: bool,
        data: &'a [u8],
        start_ns: u64,
    ) -> Result<Self, String> {
        let meanings = Meanings::of(fields.iter().map(|field| field.name));
        if let Some(missing) = meanings.missing() {
            let names: Vec<&str> = fields.iter().map(|field| field.name).collect();
            return Err(format!(
                "the cloud has fields \"{}\", must have x, y and z: {missing} is missing",
                names.join(" ")
            ));
        }
        for field in &fields {
            if field.offset.saturating_add(field.kind.bytes()) > point_bytes {
                return Err(format!("field {} goes beyond a point of {point_bytes} bytes", field.name));
            }
        }
        // Rows that would overlap are taken to follow one another.
        let row_bytes = row_bytes.max(columns.saturating_mul(point_bytes));
        Ok(Self { fields, meanings, rows, columns, point_bytes, row_bytes, is_big_endian, data, start_ns })
    }

    /// Puts the points into `cloud`, which is empty. `logged_ns` is the time where the cloud has none.
    pub(crate) fn unpack(&self, logged_ns: u64, cloud: &mut Cloud) -> LeftOut {
        let mut left_out = LeftOut { missing: self.rows as u64 * self.columns as u64, clamped: 0 };
        let start_ns = if self.start_ns == 0 { logged_ns } else { self.start_ns };
        cloud.has_ring = self.meanings.has_ring();
        cloud.has_key = self.meanings.has_column();
        cloud.has_time = self.meanings.has_time();
        // Nothing of a row without points could end the rows.
        let rows = if self.columns == 0 { 0 } else { self.rows };
        'rows: for row in 0..rows {
            for column in 0..self.columns {
                let at = row.saturating_mul(self.row_bytes).saturating_add(column * self.point_bytes);
                let Some(bytes) = self.data.get(at..at.saturating_add(self.point_bytes)) else { break 'rows };
                let number = |field: usize| {
                    let field = self.fields.get(field)?;
                    field.kind.number(bytes.get(field.offset..)?, self.is_big_endian)
                };
                let (point, fits) = self.meanings.point(start_ns, number).unwrap_or((UNREADABLE, true));
                left_out.missing -= 1;
                left_out.clamped += u64::from(!fits);
                cloud.push(point);
            }
        }
        cloud.is_torn = left_out.missing > 0;
        let earliest_ns =
            cloud.points.iter().filter(|point| point.position_m[0].is_finite()).map(|point| point.time_ns).min();
        cloud.start_ns = earliest_ns.or(Some(start_ns));
        left_out
    }
}
