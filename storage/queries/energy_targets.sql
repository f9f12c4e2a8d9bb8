-- what one assumption would have to be for the saving wanted; null where no value reaches it
select building, storey, baseline,
       round(100 * target, 1) as target_percent,
       round(100 * saving, 1) as saving_percent,
       lever, present, needed,
       best_value,
       round(100 * best_saving, 1) as best_percent
from energy_targets
order by building, storey, baseline, needed is null, best_saving desc, lever
