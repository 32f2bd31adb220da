"""Charts of the recorded benchmarks and studies.

They draw the JSON that a benchmark or a study leaves behind. A checkout that is installed with
``pip install --editable .`` finds them anywhere; they are no part of the package.

>>> charts.methods.draw(json.loads(Path("calibration/methods.json").read_text()), "steps")
"""

from calibration.charts import campaign as campaign
from calibration.charts import failures as failures
from calibration.charts import ladder as ladder
from calibration.charts import methods as methods
from calibration.charts import settings as settings
from calibration.charts import speed as speed
from calibration.charts import work_precision as work_precision
