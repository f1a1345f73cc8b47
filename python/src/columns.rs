//! Columns of numbers that Rust owns, and that NumPy and Arrow look at where they are.
//!
//! An Arrow array takes a `Vec` as it is and shares it from then on. Arrow's consumers get it by the PyCapsule
//! interface, NumPy by the array interface, which is an address with the object that keeps it alive: neither
//! copies, and neither needs a library of the other's, or of C's, here.

use arrow_array::ffi::to_ffi;
use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{Array, ArrayRef, Float64Array, RecordBatch, RecordBatchIterator, UInt32Array};
use arrow_schema::ffi::FFI_ArrowSchema;
use arrow_schema::{DataType, Field, FieldRef, Schema};
use pyo3::exceptions::{PyIndexError, PyKeyError};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict, PyIterator, PyList};
use std::collections::HashMap;
use std::sync::Arc;

const UNIT: &str = "unit";

/// Columns that come to be.
#[derive(Default)]
pub(crate) struct Table {
    fields: Vec<Field>,
    arrays: Vec<ArrayRef>,
}

impl Table {
    /// Adds a column of numbers.
    pub(crate) fn numbers(&mut self, name: impl Into<String>, unit: &str, values: Vec<f64>) {
        self.add(name, unit, Arc::new(Float64Array::from(values)));
    }

    /// Adds a column of whole numbers.
    pub(crate) fn counts(&mut self, name: impl Into<String>, values: Vec<u32>) {
        self.add(name, "", Arc::new(UInt32Array::from(values)));
    }

    fn add(&mut self, name: impl Into<String>, unit: &str, array: ArrayRef) {
        let metadata = HashMap::from([(UNIT.to_owned(), unit.to_owned())]);
        let field = Field::new(name, array.data_type().clone(), false);
        self.fields.push(field.with_metadata(metadata));
        self.arrays.push(array);
    }

    /// All of them; they are equally long.
    pub(crate) fn finish(self) -> PyResult<Columns> {
        let schema = Arc::new(Schema::new(self.fields));
        let batch = RecordBatch::try_new(schema, self.arrays);
        Ok(Columns(batch.map_err(|error| super::raised(&error))?))
    }
}

/// Columns of equal length by their names, as a mapping: `columns["t_s"]`.
///
/// `pyarrow.table(columns)`, `polars.DataFrame(columns)` and whatever else knows Arrow's PyCapsule interface
/// look at the same memory.
#[pyclass(frozen, mapping, module = "syncline")]
pub(crate) struct Columns(RecordBatch);

#[pymethods]
impl Columns {
    /// The columns' names.
    fn keys<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let schema = self.0.schema_ref();
        PyList::new(py, schema.fields().iter().map(|field| field.name()))
    }

    /// How many rows each column has.
    #[getter]
    fn rows(&self) -> usize {
        self.0.num_rows()
    }

    /// Unit of each column by its name: `mm`, `mm/s`, `s`; empty where there is none.
    #[getter]
    fn units(&self) -> HashMap<&str, &str> {
        let fields = self.0.schema_ref().fields().iter();
        fields.map(|it| (it.name().as_str(), unit(it))).collect()
    }

    fn __len__(&self) -> usize {
        self.0.num_columns()
    }

    fn __contains__(&self, name: &str) -> bool {
        self.0.column_by_name(name).is_some()
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        self.keys(py)?.try_iter()
    }

    fn __getitem__(&self, name: &str) -> PyResult<Column> {
        let schema = self.0.schema_ref();
        let found = schema.column_with_name(name);
        let (index, _) = found.ok_or_else(|| {
            let names: Vec<_> = schema
                .fields()
                .iter()
                .map(|it| it.name().as_str())
                .collect();
            PyKeyError::new_err(format!("{name}: the columns are {}", names.join(", ")))
        })?;
        Ok(Column {
            field: Arc::clone(&schema.fields()[index]),
            values: Arc::clone(self.0.column(index)),
        })
    }

    /// The Arrow PyCapsule interface: a stream of one batch.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // Another schema is a wish that may go unheard.
        let _ = requested_schema;
        let batches = RecordBatchIterator::new([Ok(self.0.clone())], self.0.schema());
        let stream = FFI_ArrowArrayStream::new(Box::new(batches));
        PyCapsule::new_with_value(py, stream, c"arrow_array_stream")
    }

    /// The Arrow PyCapsule interface: names, types and units.
    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        let schema = FFI_ArrowSchema::try_from(self.0.schema_ref().as_ref());
        let schema = schema.map_err(|error| super::raised(&error))?;
        PyCapsule::new_with_value(py, schema, c"arrow_schema")
    }

    fn __repr__(&self) -> String {
        let fields = self.0.schema_ref().fields().iter();
        let names: Vec<_> = fields.map(|it| it.name().as_str()).collect();
        format!("<{} rows of {}>", self.rows(), names.join(", "))
    }
}

/// A column of numbers. `numpy.asarray(column)` and `pyarrow.array(column)` look at the same memory, which nobody can
/// write.
#[pyclass(frozen, module = "syncline")]
pub(crate) struct Column {
    field: FieldRef,
    values: ArrayRef,
}

#[pymethods]
impl Column {
    /// Its name in the columns.
    #[getter]
    fn name(&self) -> &str {
        self.field.name()
    }

    /// Unit of its values: `mm`, `mm/s`, `s`; empty where there is none.
    #[getter]
    fn unit(&self) -> &str {
        unit(&self.field)
    }

    fn __len__(&self) -> usize {
        self.values.len()
    }

    /// One of its values; from the end where it is negative.
    fn __getitem__<'py>(&self, py: Python<'py>, at: isize) -> PyResult<Bound<'py, PyAny>> {
        let length = self.values.len();
        let place = if at < 0 { at + length as isize } else { at };
        let place = usize::try_from(place).ok().filter(|it| *it < length);
        let place = place.ok_or_else(|| {
            PyIndexError::new_err(format!("{at}: the column has {length} values"))
        })?;
        let values = self.values.as_any();
        Ok(match values.downcast_ref::<UInt32Array>() {
            Some(counts) => counts.value(place).into_pyobject(py)?.into_any(),
            None => {
                let numbers = values.downcast_ref::<Float64Array>();
                let number = numbers.map_or(f64::NAN, |numbers| numbers.value(place));
                number.into_pyobject(py)?.into_any()
            }
        })
    }

    /// NumPy's array interface.
    #[getter]
    fn __array_interface__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let order = if cfg!(target_endian = "big") {
            '>'
        } else {
            '<'
        };
        let kind = match self.values.data_type() {
            DataType::UInt32 => "u4",
            _ => "f8",
        };
        let address = self.values.to_data().buffers()[0].as_ptr() as usize;
        let interface = PyDict::new(py);
        interface.set_item("version", 3)?;
        interface.set_item("shape", (self.values.len(),))?;
        interface.set_item("typestr", format!("{order}{kind}"))?;
        interface.set_item("data", (address, true))?;
        Ok(interface)
    }

    /// The Arrow PyCapsule interface: type and unit, and the values.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_array__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<(Bound<'py, PyCapsule>, Bound<'py, PyCapsule>)> {
        // Another schema is a wish that may go unheard.
        let _ = requested_schema;
        let (array, _) = to_ffi(&self.values.to_data()).map_err(|error| super::raised(&error))?;
        Ok((
            self.__arrow_c_schema__(py)?,
            PyCapsule::new_with_value(py, array, c"arrow_array")?,
        ))
    }

    /// The Arrow PyCapsule interface: type and unit.
    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        let schema = FFI_ArrowSchema::try_from(self.field.as_ref());
        let schema = schema.map_err(|error| super::raised(&error))?;
        PyCapsule::new_with_value(py, schema, c"arrow_schema")
    }

    fn __repr__(&self) -> String {
        format!(
            "<{} values of {}, {}>",
            self.values.len(),
            self.name(),
            self.unit()
        )
    }
}

fn unit(field: &Field) -> &str {
    field.metadata().get(UNIT).map_or("", String::as_str)
}
